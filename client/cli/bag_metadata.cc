#include "client/cli/bag_metadata.h"

#include <cctype>
#include <charconv>

namespace fathom::client::cli {
namespace {

bool IsSpace(char c) {
  return std::isspace(static_cast<unsigned char>(c)) != 0;
}

// The first text behind `from` that is not blank, between two tags.
std::string TextAfter(std::string_view xml, std::size_t from) {
  while (true) {
    const std::size_t begin = xml.find('>', from);
    if (begin == std::string_view::npos) return "";
    const std::size_t end = xml.find('<', begin);
    if (end == std::string_view::npos) return "";
    std::string_view text = xml.substr(begin + 1, end - begin - 1);
    while (!text.empty() && IsSpace(text.front())) text.remove_prefix(1);
    while (!text.empty() && IsSpace(text.back())) text.remove_suffix(1);
    if (!text.empty()) return std::string(text);
    from = end;
  }
}

// "Product Uncert" and "productUncert" are one: lower case, letters alone.
std::string Letters(std::string_view text) {
  std::string letters;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalpha(byte) != 0) {
      letters += static_cast<char>(std::tolower(byte));
    }
  }
  return letters;
}

}  // namespace

BagUncertainty ReadBagUncertainty(std::string_view xml) {
  BagUncertainty uncertainty;
  const std::size_t element = xml.find("verticalUncertaintyType");
  if (element == std::string_view::npos) return uncertainty;
  uncertainty.code = TextAfter(xml, element);
  const std::string code = Letters(uncertainty.code);
  uncertainty.is_95_percent = code == "productuncert";
  uncertainty.stated = uncertainty.is_95_percent || code == "rawstddev" ||
                       code == "cubestddev" || code == "historicalstddev";
  return uncertainty;
}

std::optional<int> ReadBagEpsg(std::string_view xml) {
  // <code><..>6339</..></code><codeSpace><..>EPSG</..></codeSpace>; the
  // horizontal system comes first. The number is the text before "EPSG".
  const std::size_t space = xml.find(">EPSG<");
  if (space == std::string_view::npos) return std::nullopt;
  const std::size_t code = xml.rfind("code>", space);
  if (code == std::string_view::npos || code == 0) return std::nullopt;
  const std::size_t begin = xml.rfind("code>", code - 1);
  if (begin == std::string_view::npos) return std::nullopt;
  const std::string text = TextAfter(xml, begin);
  int number = 0;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() ||
      number < 1024 || number > 999'999) {
    return std::nullopt;
  }
  return number;
}

}  // namespace fathom::client::cli
