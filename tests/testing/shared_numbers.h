// Reads the tables of numbers in the shared reference folder: lines, and the
// numbers in a line. Absent files give an empty result: the test then skips.

#ifndef FATHOM_TESTS_TESTING_SHARED_NUMBERS_H_
#define FATHOM_TESTS_TESTING_SHARED_NUMBERS_H_

#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

namespace fathom::testing {

// The lines of a file; empty if it cannot be read.
inline std::vector<std::string> LinesOf(const std::string& path) {
  std::vector<std::string> lines;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

// All numbers of a line in their order; words between them are passed over.
inline std::vector<double> NumbersIn(const std::string& line) {
  std::vector<double> numbers;
  const char* at = line.c_str();
  while (*at != '\0') {
    const bool starts = (*at >= '0' && *at <= '9') || *at == '-' || *at == '.';
    char* end = nullptr;
    const double value = starts ? std::strtod(at, &end) : 0.0;
    if (starts && end != at) {
      numbers.push_back(value);
      at = end;
    } else {
      ++at;
    }
  }
  return numbers;
}

}  // namespace fathom::testing

#endif  // FATHOM_TESTS_TESTING_SHARED_NUMBERS_H_
