#include "client/cli/progress_bar.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "absl/strings/str_format.h"
#include "client/cli/text.h"

namespace fathom::client::cli {
namespace {

constexpr int kWidth = 30;
constexpr std::chrono::milliseconds kRedraw{100};

std::string RateText(double per_second) {
  if (per_second >= 1e6) return absl::StrFormat("%.1f M", per_second / 1e6);
  if (per_second >= 1e3) return absl::StrFormat("%.1f k", per_second / 1e3);
  return absl::StrFormat("%.0f ", per_second);
}

}  // namespace

std::string ProgressLine(const std::string& label, const std::string& unit,
                         std::uint64_t done, std::uint64_t total,
                         double elapsed_s) {
  const double share = total == 0
                           ? 1
                           : std::min(1.0, static_cast<double>(done) /
                                               static_cast<double>(total));
  const auto filled = static_cast<std::size_t>(share * kWidth);
  std::string bar(filled, '=');
  if (filled < kWidth) bar += '>';
  bar.resize(kWidth, ' ');
  std::string line =
      absl::StrFormat("%s [%s] %3.0f %%", label, bar, 100 * share);
  if (elapsed_s > 0 && done > 0) {
    const double rate = static_cast<double>(done) / elapsed_s;
    absl::StrAppendFormat(&line, "  %s%s/s", RateText(rate), unit);
    if (share < 1) {
      absl::StrAppendFormat(&line, "  %s left",
                            SpanText(elapsed_s * (1 - share) / share));
    }
  }
  return line;
}

ProgressBar::ProgressBar(std::string label, std::string unit,
                         std::uint64_t total)
    : label_(std::move(label)),
      unit_(std::move(unit)),
      total_(total),
      visible_(isatty(STDERR_FILENO) == 1),
      start_(std::chrono::steady_clock::now()),
      next_draw_(start_) {}

ProgressBar::~ProgressBar() { Finish(); }

void ProgressBar::Finish() {
  if (drawn_) std::fputc('\n', stderr);
  drawn_ = false;
}

void ProgressBar::Update(std::uint64_t done) {
  const auto now = std::chrono::steady_clock::now();
  if (!visible_ || (now < next_draw_ && done < total_)) return;
  next_draw_ = now + kRedraw;
  drawn_ = true;
  const std::chrono::duration<double> elapsed = now - start_;
  // \033[K clears what a longer line left behind.
  std::fprintf(
      stderr, "\r%s\033[K",
      ProgressLine(label_, unit_, done, total_, elapsed.count()).c_str());
  std::fflush(stderr);
}

}  // namespace fathom::client::cli
