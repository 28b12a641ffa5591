#include "tests/fault/crash_image.h"

#include <algorithm>
#include <utility>

namespace fathom::fault {

CrashImage::CrashImage(const FileSet& files) {
  for (const auto& [name, bytes] : files) files_[name].synced = bytes;
}

void CrashImage::Apply(const DiskOperation& operation) {
  File& file = files_[operation.file];
  if (operation.kind != DiskOperation::Kind::kSync) {
    file.unsynced.push_back(operation);
    return;
  }
  for (const DiskOperation& waiting : file.unsynced) {
    ApplyTo(waiting, waiting.bytes.size(), file.synced);
  }
  file.unsynced.clear();
}

void CrashImage::ApplyTo(const DiskOperation& operation, std::size_t size,
                         std::optional<FileBytes>& content) {
  switch (operation.kind) {
    case DiskOperation::Kind::kCreate:
      content.emplace();
      break;
    case DiskOperation::Kind::kDelete:
      content.reset();
      break;
    case DiskOperation::Kind::kTruncate:
      if (content.has_value()) {
        content->resize(static_cast<std::size_t>(operation.offset));
      }
      break;
    case DiskOperation::Kind::kWrite: {
      // Its file's creation was lost, or its deletion was not.
      if (!content.has_value()) break;
      const auto at = static_cast<std::size_t>(operation.offset);
      if (content->size() < at + size) content->resize(at + size);
      std::copy_n(operation.bytes.begin(), size,
                  content->begin() + operation.offset);
      break;
    }
    case DiskOperation::Kind::kSync:
      break;
  }
}

FileSet CrashImage::After(CrashMode mode, std::mt19937_64& random) const {
  FileSet files;
  for (const auto& [name, file] : files_) {
    std::optional<FileBytes> content = file.synced;
    const std::size_t count = file.unsynced.size();
    std::size_t end = count;
    if (mode == CrashMode::kNothing) end = 0;
    if (mode == CrashMode::kPrefix || mode == CrashMode::kTornPrefix) {
      end = random() % (count + 1);
    }
    const bool some = mode == CrashMode::kSome || mode == CrashMode::kTornSome;
    for (std::size_t i = 0; i < end; ++i) {
      const DiskOperation& operation = file.unsynced[i];
      if (some && random() % 2 == 0) {
        // What followed went into another file of the same name, which is not
        // to be seen while the name stands for this one.
        if (operation.kind == DiskOperation::Kind::kDelete) break;
        continue;
      }
      std::size_t size = operation.bytes.size();
      const bool torn = mode == CrashMode::kTornSome
                            ? random() % 4 == 0
                            : mode == CrashMode::kTornPrefix && i + 1 == end;
      if (torn && size > 0) size = random() % size;
      ApplyTo(operation, size, content);
    }
    if (content.has_value()) files[name] = *std::move(content);
  }
  return files;
}

}  // namespace fathom::fault
