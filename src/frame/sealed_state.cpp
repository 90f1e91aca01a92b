#include "frame/sealed_state.h"

#include <algorithm>
#include <stdexcept>

#include "compute/archive.h"
#include "frame/checksum.h"

namespace tissue_sim {
namespace {

constexpr char kMagic[16] = "tissue_sim\nstat";
/// Of all that is written in a state. Whoever changes what a `fields()` lists counts on.
constexpr std::uint32_t kVersion = 7;

struct Head {
  char magic[16];
  std::uint32_t version, reserved;
  std::uint64_t size;      ///< of what follows [bytes]
  std::uint64_t checksum;  ///< of what follows
};

std::uint64_t checksum_of(Span<const std::uint8_t> bytes) {
  Checksum sum;
  sum.add(bytes);
  return sum.value();
}

[[noreturn]] void refuse(const std::string& why) {
  throw std::runtime_error("the state cannot be restored: " + why);
}

/// The first line in which two scenes differ.
std::string first_difference(const std::string& a, const std::string& b) {
  const auto differ = std::mismatch(a.begin(), a.end(), b.begin(), b.end());
  const auto line = [](const std::string& text, std::size_t at) {
    const std::size_t begin = at == 0 ? 0 : text.rfind('\n', at - 1) + 1;
    const std::string all = text.substr(std::min(begin, text.size()));
    return all
        .substr(all.find_first_not_of(' ') == std::string::npos ? 0 : all.find_first_not_of(' '))
        .substr(0, 80);
  };
  const auto one = line(a, static_cast<std::size_t>(differ.first - a.begin()));
  const auto other = line(b, static_cast<std::size_t>(differ.second - b.begin()));
  return "'" + one.substr(0, one.find('\n')) + "' is '" + other.substr(0, other.find('\n')) +
         "' here";
}

}  // namespace

std::vector<std::uint8_t> seal_state(const StateOrigin& origin,
                                     const std::vector<std::uint8_t>& state) {
  ArchiveWriter body;
  StateOrigin written = origin;
  body(written.scene, written.device);
  std::vector<std::uint8_t> bytes = body.take();
  bytes.insert(bytes.end(), state.begin(), state.end());
  Head head = {};
  std::copy(std::begin(kMagic), std::end(kMagic), head.magic);
  head.version = kVersion;
  head.size = bytes.size();
  head.checksum = checksum_of(Span<const std::uint8_t>(bytes.data(), bytes.size()));
  static_assert(std::has_unique_object_representations_v<Head>);
  std::vector<std::uint8_t> sealed(sizeof head + bytes.size());
  std::memcpy(sealed.data(), &head, sizeof head);
  std::copy(bytes.begin(), bytes.end(), sealed.begin() + sizeof head);
  return sealed;
}

Span<const std::uint8_t> open_state(Span<const std::uint8_t> sealed, const StateOrigin& origin) {
  Head head;
  const std::size_t head_size = sizeof head;
  const auto known = std::min(sealed.size(), sizeof kMagic);
  if (known == 0 || !std::equal(kMagic, kMagic + known, sealed.begin(),
                                [](char a, std::uint8_t b) { return a == static_cast<char>(b); })) {
    refuse("it is no state of this package");
  }
  if (sealed.size() < head_size) refuse("it is cut short");
  std::memcpy(&head, sealed.data(), head_size);
  if (head.version != kVersion) {
    refuse("it is of version " + std::to_string(head.version) + " of states, this program's is " +
           std::to_string(kVersion));
  }
  const Span<const std::uint8_t> body(sealed.data() + head_size, sealed.size() - head_size);
  if (body.size() < head.size) {
    refuse("it is cut short: " + std::to_string(body.size()) + " of " + std::to_string(head.size) +
           " bytes");
  }
  if (body.size() > head.size || checksum_of(body) != head.checksum) {
    refuse("it is damaged: its checksum is another");
  }
  ArchiveReader in(body);
  StateOrigin of;
  in(of.scene, of.device);
  if (of.scene != origin.scene) {
    refuse("it is of another scene, whose " + first_difference(of.scene, origin.scene) +
           ": load that scene first");
  }
  if (of.device != origin.device) {
    refuse("it is of the device " + of.device + ", this is " + origin.device);
  }
  return {body.end() - in.left(), in.left()};
}

}  // namespace tissue_sim
