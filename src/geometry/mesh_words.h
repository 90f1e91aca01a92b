// Readers of text in mesh files: whatever stands there, nothing is read beyond the end.
#pragma once

#include <locale.h>

#include <cctype>
#include <cstdlib>
#include <string>

namespace tissue_sim {

/// The words of a text that must outlive it.
class MeshWords {
 public:
  MeshWords(const std::string& text, std::size_t first)
      : begin_(text.c_str()), at_(begin_ + first), end_(begin_ + text.size()) {}

  /// In small letters; false at the end.
  bool next(std::string& word) {
    while (at_ != end_ && is_space(*at_)) ++at_;
    return word_here(word);
  }
  /// The same, within the line.
  bool next_in_line(std::string& word) {
    skip_blanks();
    return word_here(word);
  }
  /// With a decimal point, whatever the program's locale; false where no number stands.
  bool next(double& number) {
    while (at_ != end_ && is_space(*at_)) ++at_;
    return number_here(number);
  }
  bool next_in_line(double& number) {
    skip_blanks();
    return number_here(number);
  }
  /// To its end, which is left to be skipped as a space.
  void skip_line() {
    while (at_ != end_ && *at_ != '\n' && *at_ != '\r') ++at_;
  }
  /// Spaces, and lines that begin with `mark`.
  void skip_comments(char mark) {
    while (at_ != end_ && (is_space(*at_) || *at_ == mark)) {
      if (*at_ == mark) {
        skip_line();
      } else {
        ++at_;
      }
    }
  }
  bool at_end() const { return at_ == end_; }
  std::size_t place() const { return static_cast<std::size_t>(at_ - begin_); }

 private:
  static bool is_space(char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; }
  void skip_blanks() {
    while (at_ != end_ && is_space(*at_) && *at_ != '\n' && *at_ != '\r') ++at_;
  }
  bool word_here(std::string& word) {
    word.clear();
    for (; at_ != end_ && !is_space(*at_); ++at_) {
      word += static_cast<char>(std::tolower(static_cast<unsigned char>(*at_)));
    }
    return !word.empty();
  }
  bool number_here(double& number) {
    static const locale_t kClassic = newlocale(LC_ALL_MASK, "C", nullptr);
    if (at_ == end_ || is_space(*at_)) return false;  // strtod would look in the next line
    char* end = nullptr;
    number = strtod_l(at_, &end, kClassic);
    if (end == at_ || (end != end_ && !is_space(*end))) return false;
    at_ = end;
    return true;
  }

  const char *begin_, *at_, *end_;
};

}  // namespace tissue_sim
