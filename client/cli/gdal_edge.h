// GDAL's manners turned into ours: errors as statuses, handles that close.
// Included by the .cc files that use GDAL, never by a header of ours.

#ifndef FATHOM_CLIENT_CLI_GDAL_EDGE_H_
#define FATHOM_CLIENT_CLI_GDAL_EDGE_H_

#include <cpl_error.h>
#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <memory>
#include <string>

#include "absl/status/status.h"

namespace fathom::client::cli {

struct CloseDataset {
  void operator()(GDALDataset* dataset) const { GDALClose(dataset); }
};
using DatasetPtr = std::unique_ptr<GDALDataset, CloseDataset>;

struct DestroyTransformation {
  void operator()(OGRCoordinateTransformation* transformation) const {
    OGRCoordinateTransformation::DestroyCT(transformation);
  }
};
using TransformationPtr =
    std::unique_ptr<OGRCoordinateTransformation, DestroyTransformation>;

// While it lives, GDAL prints nothing on this thread and the last failure is
// kept.
class GdalErrors {
 public:
  GdalErrors() { CPLPushErrorHandlerEx(&GdalErrors::Handle, this); }
  ~GdalErrors() { CPLPopErrorHandler(); }
  GdalErrors(const GdalErrors&) = delete;
  GdalErrors& operator=(const GdalErrors&) = delete;

  // GDAL's words on the last failure, else its last warning, else a general
  // one.
  std::string message() const {
    if (!message_.empty()) return message_;
    return warning_.empty() ? "GDAL gives no reason" : warning_;
  }
  bool failed() const { return !message_.empty(); }

 private:
  static void CPL_STDCALL Handle(CPLErr level, CPLErrorNum /*number*/,
                                 const char* text) {
    auto* errors = static_cast<GdalErrors*>(CPLGetErrorHandlerUserData());
    if (level == CE_Warning) errors->warning_ = text;
    if (level >= CE_Failure) errors->message_ = text;
  }

  std::string message_;
  std::string warning_;
};

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_GDAL_EDGE_H_
