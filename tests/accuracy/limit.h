// One limit of an accuracy figure.

#ifndef FATHOM_TESTS_ACCURACY_LIMIT_H_
#define FATHOM_TESTS_ACCURACY_LIMIT_H_

#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "tests/testing/worse.h"

namespace fathom::accuracy {

// The worst of what it was offered, and whether all stayed within; NaN does
// not.
class Limit {
 public:
  Limit(std::string what, double most) : what_(std::move(what)), most_(most) {}

  void Offer(double value, const std::string& where) {
    if (offered_ && !testing::IsWorse(value, worst_)) return;
    offered_ = true;
    worst_ = value;
    where_ = where;
  }
  // Prints the line; 1 if missed.
  int Report() const {
    if (!offered_) return 0;
    const bool missed = !(worst_ <= most_);
    std::printf("%-6s %-58s %8.3g <= %-6g (%s)\n", missed ? "MISSED" : "ok",
                what_.c_str(), worst_, most_, where_.c_str());
    return missed ? 1 : 0;
  }

 private:
  std::string what_;
  double most_;
  bool offered_ = false;
  double worst_ = 0;
  std::string where_ = {};
};

// What names the row.
inline std::string Where(const nlohmann::json& row) {
  std::string where;
  for (const char* key : {"scene", "hits", "covered", "cell_m"}) {
    if (!row.contains(key)) continue;
    if (!where.empty()) where += ' ';
    where += row[key].is_string() ? row[key].get<std::string>()
                                  : key + ("=" + row[key].dump());
  }
  return where;
}

}  // namespace fathom::accuracy

#endif  // FATHOM_TESTS_ACCURACY_LIMIT_H_
