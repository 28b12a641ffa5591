#include "client/cli/topotype.h"

#include <cctype>
#include <cmath>
#include <fstream>
#include <locale>
#include <map>
#include <optional>
#include <sstream>
#include <vector>

#include "absl/strings/str_format.h"
#include "client/cli/arguments.h"

namespace fathom::client::cli {
namespace {

constexpr int kHeaderLines = 6;
// A header line is short; a longer first line is another format.
constexpr std::size_t kMaxHeaderLine = 200;

struct Header {
  std::map<std::string, double> values;

  std::optional<double> Get(std::initializer_list<const char*> names) const {
    for (const char* name : names) {
      const auto found = values.find(name);
      if (found != values.end()) return found->second;
    }
    return std::nullopt;
  }
};

// One line of a name and a number in either order; cellsize may have two.
bool ReadHeaderLine(const std::string& line, Header& header) {
  if (line.size() > kMaxHeaderLine) return false;
  std::istringstream words(line);
  std::string name;
  std::vector<double> numbers;
  for (std::string word; words >> word;) {
    if (const auto number = ParseNumber(word); number.ok()) {
      numbers.push_back(*number);
    } else if (name.empty()) {
      for (char& c : word) {
        c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      }
      name = word;
    } else {
      return false;
    }
  }
  if (name.empty() || numbers.empty() || numbers.size() > 2) return false;
  header.values[name] = numbers[0];
  if (numbers.size() == 2) header.values["dy"] = numbers[1];
  return true;
}

}  // namespace

absl::StatusOr<DatasetPtr> OpenTopotype(const std::string& path) {
  std::ifstream in(path);
  in.imbue(std::locale::classic());
  Header header;
  std::string line;
  for (int i = 0; i < kHeaderLines; ++i) {
    if (!std::getline(in, line) || !ReadHeaderLine(line, header)) {
      return absl::NotFoundError("no topotype header");
    }
  }
  const auto columns = header.Get({"ncols", "mx"});
  const auto rows = header.Get({"nrows", "my"});
  const auto x = header.Get({"xlower", "xllcenter", "xllcorner", "xll"});
  const auto y = header.Get({"ylower", "yllcenter", "yllcorner", "yll"});
  const auto dx = header.Get({"cellsize", "dx"});
  const auto dy = header.Get({"dy", "cellsize", "dx"});
  if (!columns || !rows || !x || !y || !dx || !dy || *dx <= 0 || *dy <= 0 ||
      *columns < 1 || *rows < 1 || *columns != std::floor(*columns) ||
      *rows != std::floor(*rows)) {
    return absl::NotFoundError("no topotype header");
  }
  if (*columns * *rows > kMaxTopotypeCells) {
    return absl::ResourceExhaustedError(absl::StrFormat(
        "%.0f x %.0f cells of text: up to %.0f are read; turn it into a "
        "GeoTIFF first",
        *columns, *rows, kMaxTopotypeCells));
  }
  const int width = static_cast<int>(*columns);
  const int height = static_cast<int>(*rows);
  DatasetPtr dataset(GetGDALDriverManager()->GetDriverByName("MEM")->Create(
      "", width, height, 1, GDT_Float32, nullptr));
  if (dataset == nullptr) {
    return absl::ResourceExhaustedError("not enough memory for its cells");
  }
  const bool corner = header.Get({"xllcorner", "xll"}).has_value();
  const double west = corner ? *x : *x - *dx / 2;
  const double south = corner ? *y : *y - *dy / 2;
  double geotransform[6] = {west, *dx, 0, south + *dy * height, 0, -*dy};
  dataset->SetGeoTransform(geotransform);
  GDALRasterBand& band = *dataset->GetRasterBand(1);
  if (const auto nodata = header.Get(
          {"nodata_value", "nodata", "no_data_value", "nodataval"})) {
    band.SetNoDataValue(*nodata);
  }
  std::vector<float> values(static_cast<std::size_t>(width));
  for (int row = 0; row < height; ++row) {
    for (float& value : values) {
      double number = 0;
      if (!(in >> number)) {
        return absl::DataLossError(absl::StrFormat(
            "damaged or cut off: row %d of %d lacks numbers", row + 1, height));
      }
      value = static_cast<float>(number);
    }
    if (band.RasterIO(GF_Write, 0, row, width, 1, values.data(), width, 1,
                      GDT_Float32, 0, 0, nullptr) != CE_None) {
      return absl::ResourceExhaustedError("not enough memory for its cells");
    }
  }
  return dataset;
}

}  // namespace fathom::client::cli
