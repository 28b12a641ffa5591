// What the XML inside a Bathymetric Attributed Grid says that GDAL does not
// hand on. Plain text search: two generations of the schema are about, and
// files with the elements of both. No GDAL. Thread-safe.

#ifndef FATHOM_CLIENT_CLI_BAG_METADATA_H_
#define FATHOM_CLIENT_CLI_BAG_METADATA_H_

#include <optional>
#include <string>
#include <string_view>

namespace fathom::client::cli {

// What a BAG's uncertainty layer holds (BAG format specification 2.0,
// BAG_VertUncertCode).
struct BagUncertainty {
  // As written: "productUncert", "Raw Std Dev", "unknown"; "": not stated.
  std::string code;
  // productUncert alone states 95 % confidence (NOAA's standard product
  // uncertainty); deviations (rawStdDev, cubeStdDev, historicalStdDev) are one
  // sigma. What is unknown is taken as one sigma too: too large rather than
  // too small.
  bool is_95_percent = false;
  // The file says which; else it was assumed.
  bool stated = false;
};

BagUncertainty ReadBagUncertainty(std::string_view xml);

// The EPSG number of the horizontal system where the file names it by number
// instead of by WKT, which GDAL 3.6 does not understand.
std::optional<int> ReadBagEpsg(std::string_view xml);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_BAG_METADATA_H_
