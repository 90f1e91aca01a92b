// The format: http://wiki.ros.org/Bags/Format/2.0
#include "ros/bag_repair.h"

#include <fcntl.h>
#include <roslz4/lz4s.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <stdexcept>
#include <vector>

namespace tissue_sim {
namespace {

constexpr char kMagic[] = "#ROSBAG V2.0\n";
constexpr std::uint32_t kMostHeader = 1u << 20, kMostChunk = 1u << 30;  // [bytes]
constexpr std::uint64_t kMostGiven = 1u << 20;                          // for an index [bytes]
enum Op : char {
  kMessage = 2,
  kFileHeader = 3,
  kIndex = 4,
  kChunk = 5,
  kChunkInfo = 6,
  kConnection = 7
};

template <class T>
T number(const std::string& bytes) {
  T value = 0;
  if (bytes.size() >= sizeof value) std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

template <class T>
std::string bytes_of(T value) {
  return std::string(reinterpret_cast<const char*>(&value), sizeof value);
}

using Fields = std::map<std::string, std::string>;

/// Fields of a record's header; false for what is none.
bool read_fields(const std::string& header, Fields& fields) {
  fields.clear();
  for (std::size_t at = 0; at < header.size();) {
    if (header.size() - at < 4) return false;
    const auto size = number<std::uint32_t>(header.substr(at, 4));
    at += 4;
    if (size > header.size() - at) return false;
    const std::string field = header.substr(at, size);
    at += size;
    const std::size_t equals = field.find('=');
    if (equals == std::string::npos) return false;
    fields[field.substr(0, equals)] = field.substr(equals + 1);
  }
  return true;
}

std::string field(const std::string& name, const std::string& value) {
  const std::string text = name + "=" + value;
  return bytes_of(static_cast<std::uint32_t>(text.size())) + text;
}

std::string record(const std::string& header, const std::string& data) {
  return bytes_of(static_cast<std::uint32_t>(header.size())) + header +
         bytes_of(static_cast<std::uint32_t>(data.size())) + data;
}

std::string op_field(Op op) { return field("op", std::string(1, op)); }

char op_of(const Fields& fields) {
  const auto op = fields.find("op");
  return op != fields.end() && op->second.size() == 1 ? op->second[0] : '\0';
}

struct IndexEntry {
  std::string time;  // sec, nsec
  std::uint32_t offset;
};

struct ChunkIndex {
  std::uint64_t place = 0, end_place = 0;
  std::map<std::uint32_t, std::vector<IndexEntry>> messages;  // by connection
  std::uint64_t begin = 0, end = 0;                           // sec << 32 | nsec
};

struct Connection {
  std::string topic, data;
};

std::uint64_t order_of(const std::string& time) {
  return static_cast<std::uint64_t>(number<std::uint32_t>(time)) << 32 |
         number<std::uint32_t>(time.substr(4));
}

/// What a chunk's bytes hold; false where they are damaged.
bool read_chunk(const std::string& bytes, std::map<std::uint32_t, Connection>& connections,
                ChunkIndex& index) {
  Fields fields;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t begin = at;
    std::string parts[2];  // header, data
    for (std::string& part : parts) {
      if (bytes.size() - at < 4) return false;
      const auto size = number<std::uint32_t>(bytes.substr(at, 4));
      at += 4;
      if (size > bytes.size() - at) return false;
      if (&part == &parts[0] || op_of(fields) == kConnection) part = bytes.substr(at, size);
      at += size;
      if (&part == &parts[0] && !read_fields(part, fields)) return false;
    }
    const auto id = number<std::uint32_t>(fields["conn"]);
    if (op_of(fields) == kConnection) {
      connections[id] = {fields["topic"], parts[1]};
    } else if (op_of(fields) == kMessage && fields["time"].size() == 8) {
      index.messages[id].push_back({fields["time"], static_cast<std::uint32_t>(begin)});
      const std::uint64_t time = order_of(fields["time"]);
      if (index.begin == 0 || time < index.begin) index.begin = time;
      index.end = std::max(index.end, time);
    } else {
      return false;
    }
  }
  return true;
}

/// With pread and pwrite: a stream would keep what a full disk did not take, and write it later.
class File {
 public:
  explicit File(const std::string& path)
      : path_(path), number_(open(path.c_str(), O_RDWR | O_CLOEXEC | O_NONBLOCK)) {
    struct stat status;
    if (number_ < 0 || fstat(number_, &status) != 0 || !S_ISREG(status.st_mode)) {
      if (number_ >= 0) close(number_);
      throw std::runtime_error(path + " is no file that can be written to");
    }
    size_ = static_cast<std::uint64_t>(status.st_size);
  }
  ~File() { close(number_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  std::uint64_t size() const { return size_; }
  /// False where the file ends before.
  bool read(std::uint64_t at, std::uint64_t count, std::string& bytes) {
    if (at > size_ || count > size_ - at) return false;
    bytes.resize(count);
    return move(at, count, [&](std::uint64_t done, std::uint64_t place) {
      return pread(number_, &bytes[done], count - done, static_cast<off_t>(place));
    });
  }
  /// Header and place of the data of the record at `at`; false where it does not lie in the file.
  bool record_at(std::uint64_t at, Fields& fields, std::uint64_t& data, std::uint32_t& data_size) {
    std::string bytes;
    if (!read(at, 4, bytes)) return false;
    const auto size = number<std::uint32_t>(bytes);
    if (size > kMostHeader || !read(at + 4, size, bytes) || !read_fields(bytes, fields)) {
      return false;
    }
    if (!read(at + 4 + size, 4, bytes)) return false;
    data_size = number<std::uint32_t>(bytes);
    data = at + 8 + size;
    return data_size <= size_ - data;
  }
  /// False where the disk is full.
  bool write(std::uint64_t at, const std::string& bytes) {
    return move(at, bytes.size(), [&](std::uint64_t done, std::uint64_t place) {
      return pwrite(number_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(place));
    });
  }
  void cut_off(std::uint64_t size) {
    if (ftruncate(number_, static_cast<off_t>(size)) != 0) {
      throw std::runtime_error(path_ + " cannot be shortened: " + std::strerror(errno));
    }
    size_ = size;
  }

 private:
  template <class Call>
  static bool move(std::uint64_t at, std::uint64_t count, const Call& call) {
    for (std::uint64_t done = 0; done < count;) {
      const ssize_t moved = call(done, at + done);
      if (moved < 0 && errno == EINTR) continue;
      if (moved <= 0) return false;
      done += static_cast<std::uint64_t>(moved);
    }
    return true;
  }

  std::string path_;
  int number_;
  std::uint64_t size_ = 0;
};

bool decompress(const std::string& kind, std::uint32_t size, std::string& bytes) {
  if (kind == "none") return bytes.size() == size;
  if (kind != "lz4" || size > kMostChunk) return false;
  std::string plain(size, '\0');
  unsigned done = size;
  const int result =
      roslz4_buffToBuffDecompress(&bytes[0], static_cast<unsigned>(bytes.size()), &plain[0], &done);
  if (result != ROSLZ4_OK || done != size) return false;
  bytes.swap(plain);
  return true;
}

std::string index_records(const ChunkIndex& chunk) {
  std::string records;
  for (const auto& [id, entries] : chunk.messages) {
    std::string data;
    for (const IndexEntry& e : entries) data += e.time + bytes_of(e.offset);
    records += record(op_field(kIndex) + field("ver", bytes_of(std::uint32_t{1})) +
                          field("conn", bytes_of(id)) +
                          field("count", bytes_of(static_cast<std::uint32_t>(entries.size()))),
                      data);
  }
  return records;
}

std::string time_field(const char* name, std::uint64_t time) {
  return field(name, bytes_of(static_cast<std::uint32_t>(time >> 32)) +
                         bytes_of(static_cast<std::uint32_t>(time)));
}

/// Connections and chunks, as they stand at the end of a bag; counts the messages.
std::string index_of(const std::map<std::uint32_t, Connection>& connections,
                     const std::vector<ChunkIndex>& chunks, std::uint64_t& messages) {
  std::string index;
  for (const auto& [id, connection] : connections) {
    index += record(
        op_field(kConnection) + field("conn", bytes_of(id)) + field("topic", connection.topic),
        connection.data);
  }
  messages = 0;
  for (const ChunkIndex& chunk : chunks) {
    std::string counts;
    for (const auto& [id, entries] : chunk.messages) {
      messages += entries.size();
      counts += bytes_of(id) + bytes_of(static_cast<std::uint32_t>(entries.size()));
    }
    index += record(op_field(kChunkInfo) + field("ver", bytes_of(std::uint32_t{1})) +
                        field("chunk_pos", bytes_of(chunk.place)) +
                        time_field("start_time", chunk.begin) + time_field("end_time", chunk.end) +
                        field("count", bytes_of(static_cast<std::uint32_t>(chunk.messages.size()))),
                    counts);
  }
  return index;
}

/// Whether so many records lie from `at` on: a copy that was broken off has not all of its index.
bool is_whole(File& file, std::uint64_t at, std::uint64_t count) {
  Fields fields;
  std::uint64_t data = 0;
  std::uint32_t size = 0;
  for (; count > 0 && file.record_at(at, fields, data, size); --count) at = data + size;
  return count == 0;
}

}  // namespace

BagRepair repair_bag(const std::string& path) {
  File file(path);
  std::string bytes;
  const std::uint64_t first = sizeof kMagic - 1;
  Fields fields;
  std::uint64_t data = 0;
  std::uint32_t size = 0;
  if (!file.read(0, first, bytes) || bytes != kMagic ||
      !file.record_at(first, fields, data, size) || op_of(fields) != kFileHeader) {
    throw std::runtime_error(path + " is no bag of version 2.0, or ends within its first bytes");
  }
  const auto known = number<std::uint64_t>(fields["index_pos"]);
  const std::uint64_t begin = data + size;
  BagRepair result;
  const std::uint64_t records = std::uint64_t{number<std::uint32_t>(fields["conn_count"])} +
                                number<std::uint32_t>(fields["chunk_count"]);
  if (known >= begin && known < file.size() && is_whole(file, known, records)) return result;

  std::map<std::uint32_t, Connection> connections;
  std::vector<ChunkIndex> chunks;
  std::uint64_t end = begin;
  while (file.record_at(end, fields, data, size)) {
    if (op_of(fields) == kIndex) {  // of the chunk before
      end = data + size;
      continue;
    }
    if (op_of(fields) != kChunk || size == 0 || !file.read(data, size, bytes)) break;
    ChunkIndex chunk;
    chunk.place = end;
    if (!decompress(fields["compression"], number<std::uint32_t>(fields["size"]), bytes)) break;
    if (!read_chunk(bytes, connections, chunk)) break;
    chunk.end_place = data + size;
    if (!chunk.messages.empty()) chunks.push_back(std::move(chunk));
    end = data + size;
  }
  if (chunks.empty()) throw std::runtime_error(path + " holds no whole chunk of messages");
  const std::uint64_t all = file.size(), whole = chunks.back().end_place;
  for (;; chunks.pop_back()) {
    if (chunks.empty() || whole - chunks.back().end_place > kMostGiven) {
      throw std::runtime_error("the index of " + path + " cannot be written: the disk is full");
    }
    const std::uint64_t chunk_end = chunks.back().end_place;
    const std::string last = index_records(chunks.back());  // it may lack them, or some
    const std::uint64_t index_at = chunk_end + last.size();
    file.cut_off(chunk_end);
    // On a disk that is full to the last byte the last chunks make room for the index: but not all
    // of them, for whoever filled it may go on.
    if (!file.write(chunk_end, last + index_of(connections, chunks, result.messages))) continue;
    result.chunks = chunks.size();
    result.lost = all - std::min(all, index_at);
    const std::string header =
        op_field(kFileHeader) + field("index_pos", bytes_of(index_at)) +
        field("conn_count", bytes_of(static_cast<std::uint32_t>(connections.size()))) +
        field("chunk_count", bytes_of(static_cast<std::uint32_t>(chunks.size())));
    const std::uint64_t room = begin - first;
    if (header.size() + 8 > room ||
        !file.write(first, record(header, std::string(room - header.size() - 8, ' ')))) {
      throw std::runtime_error("the header of " + path + " cannot be written");
    }
    return result;
  }
}

}  // namespace tissue_sim
