// What `fathom watch` keeps of its events, and how it looks in a terminal.
//
// Not thread-safe.

#ifndef FATHOM_CLIENT_CLI_WATCH_PICTURE_H_
#define FATHOM_CLIENT_CLI_WATCH_PICTURE_H_

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "fathom/v1/obstacle_service.pb.h"

namespace fathom::client::cli {

// Side of the picture of an area, characters.
inline constexpr std::uint32_t kPictureColumns = 72;
inline constexpr std::uint32_t kPictureRows = 24;

// An area as a picture of characters: each the shoalest depth of the cells that
// fall on it.
class RegionPicture {
 public:
  void Take(const v1::WatchRegionResponse& event);
  // Rows of characters, '#' the shoalest to '.' the deepest, ' ' unknown, and
  // what they mean.
  std::string Text() const;

 private:
  void Resize(std::uint32_t rows, std::uint32_t columns);

  std::uint32_t rows_ = 0;
  std::uint32_t columns_ = 0;
  std::vector<float> shoalest_m_;
};

// The contacts by source and id.
class ContactsPicture {
 public:
  void Take(const v1::WatchContactsResponse& event);
  // Those that are not dropped, a line each.
  std::string Text() const;

 private:
  std::map<std::pair<std::string, std::string>, v1::ContactEstimate> contacts_;
};

// One line for an event.
std::string EventText(const v1::WatchRegionResponse& event);
std::string EventText(const v1::WatchContactsResponse& event);
std::string EventText(const v1::WatchTrajectoryResponse& event);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_WATCH_PICTURE_H_
