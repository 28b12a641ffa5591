#include "storage/checked_pages.h"

#include <sqlite3.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "base/crc32c.h"

namespace fathom::storage {
namespace {

// Of the header of an SQLite file (sqlite.org/fileformat2.html 1.3).
constexpr int kHeaderBytes = 100;
constexpr std::size_t kReservedBytesOffset = 20;
constexpr char kMagic[] = "SQLite format 3";

// What SQLite holds of an open file.
struct File {
  sqlite3_file base;
  // The real one; from sqlite3_malloc.
  sqlite3_file* real;
  // Only a main database has pages.
  bool is_database;
  bool checked;
  // Room for a page on its way to the disk; from sqlite3_malloc.
  std::uint8_t* page;
  int page_bytes;
};

File& Of(sqlite3_file* file) { return *reinterpret_cast<File*>(file); }
sqlite3_file* Real(sqlite3_file* file) { return Of(file).real; }
const sqlite3_io_methods& Methods(sqlite3_file* file) {
  return *Real(file)->pMethods;
}
sqlite3_vfs* Below() { return sqlite3_vfs_find(nullptr); }

bool IsPage(int size, sqlite3_int64 offset) {
  return size >= 512 && (size & (size - 1)) == 0 && offset % size == 0;
}

void NoteHeader(File& file, const std::uint8_t* bytes, int size,
                sqlite3_int64 offset) {
  if (offset != 0 || size < kHeaderBytes ||
      std::memcmp(bytes, kMagic, sizeof(kMagic)) != 0) {
    return;
  }
  file.checked = bytes[kReservedBytesOffset] == kPageChecksumBytes;
}

std::uint32_t ChecksumOf(const std::uint8_t* page, int size,
                         sqlite3_int64 offset) {
  const auto content = static_cast<std::size_t>(size - kPageChecksumBytes);
  return PageChecksum(static_cast<std::uint32_t>(offset / size + 1),
                      ByteSpan(page, content));
}

std::uint32_t LoadChecksum(const std::uint8_t* page, int size) {
  const std::uint8_t* p = page + size - kPageChecksumBytes;
  return static_cast<std::uint32_t>(p[0]) |
         static_cast<std::uint32_t>(p[1]) << 8 |
         static_cast<std::uint32_t>(p[2]) << 16 |
         static_cast<std::uint32_t>(p[3]) << 24;
}

int Close(sqlite3_file* file) {
  const int result = Methods(file).xClose(Real(file));
  sqlite3_free(Of(file).real);
  sqlite3_free(Of(file).page);
  return result;
}

int Read(sqlite3_file* file, void* to, int size, sqlite3_int64 offset) {
  const int result = Methods(file).xRead(Real(file), to, size, offset);
  File& ours = Of(file);
  if (result != SQLITE_OK || !ours.is_database) return result;
  const auto* bytes = static_cast<const std::uint8_t*>(to);
  NoteHeader(ours, bytes, size, offset);
  if (!ours.checked || !IsPage(size, offset)) return SQLITE_OK;
  if (LoadChecksum(bytes, size) == ChecksumOf(bytes, size, offset)) {
    return SQLITE_OK;
  }
  const bool zero = std::all_of(bytes, bytes + size,
                                [](std::uint8_t byte) { return byte == 0; });
  return zero ? SQLITE_OK : SQLITE_IOERR_DATA;
}

int Write(sqlite3_file* file, const void* from, int size,
          sqlite3_int64 offset) {
  File& ours = Of(file);
  const auto* bytes = static_cast<const std::uint8_t*>(from);
  if (ours.is_database) NoteHeader(ours, bytes, size, offset);
  if (!ours.is_database || !ours.checked || !IsPage(size, offset)) {
    return Methods(file).xWrite(Real(file), from, size, offset);
  }
  if (ours.page_bytes < size) {
    sqlite3_free(ours.page);
    ours.page = static_cast<std::uint8_t*>(sqlite3_malloc(size));
    ours.page_bytes = ours.page == nullptr ? 0 : size;
    if (ours.page == nullptr) return SQLITE_IOERR_NOMEM;
  }
  std::copy_n(bytes, size, ours.page);
  const std::uint32_t checksum = ChecksumOf(bytes, size, offset);
  std::uint8_t* const end = ours.page + size - kPageChecksumBytes;
  for (int i = 0; i < kPageChecksumBytes; ++i) {
    end[i] = static_cast<std::uint8_t>(checksum >> (8 * i));
  }
  return Methods(file).xWrite(Real(file), ours.page, size, offset);
}

int Truncate(sqlite3_file* file, sqlite3_int64 size) {
  return Methods(file).xTruncate(Real(file), size);
}
int Sync(sqlite3_file* file, int flags) {
  return Methods(file).xSync(Real(file), flags);
}
int FileSize(sqlite3_file* file, sqlite3_int64* size) {
  return Methods(file).xFileSize(Real(file), size);
}
int Lock(sqlite3_file* file, int level) {
  return Methods(file).xLock(Real(file), level);
}
int Unlock(sqlite3_file* file, int level) {
  return Methods(file).xUnlock(Real(file), level);
}
int CheckReservedLock(sqlite3_file* file, int* held) {
  return Methods(file).xCheckReservedLock(Real(file), held);
}
int FileControl(sqlite3_file* file, int operation, void* argument) {
  if (operation == kFileControlCheckPages) {
    Of(file).checked = true;
    return SQLITE_OK;
  }
  return Methods(file).xFileControl(Real(file), operation, argument);
}
int SectorSize(sqlite3_file* file) {
  return Methods(file).xSectorSize(Real(file));
}
int Characteristics(sqlite3_file* file) {
  return Methods(file).xDeviceCharacteristics(Real(file));
}
int SharedMap(sqlite3_file* file, int region, int size, int extend,
              void volatile** mapped) {
  return Methods(file).xShmMap(Real(file), region, size, extend, mapped);
}
int SharedLock(sqlite3_file* file, int offset, int count, int flags) {
  return Methods(file).xShmLock(Real(file), offset, count, flags);
}
void SharedBarrier(sqlite3_file* file) {
  Methods(file).xShmBarrier(Real(file));
}
int SharedUnmap(sqlite3_file* file, int remove) {
  return Methods(file).xShmUnmap(Real(file), remove);
}

// Version 2: no memory mapping, which would pass by Read.
constexpr sqlite3_io_methods kMethods = {
    .iVersion = 2,
    .xClose = Close,
    .xRead = Read,
    .xWrite = Write,
    .xTruncate = Truncate,
    .xSync = Sync,
    .xFileSize = FileSize,
    .xLock = Lock,
    .xUnlock = Unlock,
    .xCheckReservedLock = CheckReservedLock,
    .xFileControl = FileControl,
    .xSectorSize = SectorSize,
    .xDeviceCharacteristics = Characteristics,
    .xShmMap = SharedMap,
    .xShmLock = SharedLock,
    .xShmBarrier = SharedBarrier,
    .xShmUnmap = SharedUnmap,
    .xFetch = nullptr,
    .xUnfetch = nullptr,
};

int Open(sqlite3_vfs*, const char* path, sqlite3_file* file, int flags,
         int* out_flags) {
  File& ours = Of(file);
  ours = File{};
  sqlite3_vfs* const below = Below();
  ours.real = static_cast<sqlite3_file*>(sqlite3_malloc(below->szOsFile));
  if (ours.real == nullptr) return SQLITE_NOMEM;
  std::memset(ours.real, 0, static_cast<std::size_t>(below->szOsFile));
  const int result = below->xOpen(below, path, ours.real, flags, out_flags);
  if (ours.real->pMethods == nullptr) {
    sqlite3_free(ours.real);
    ours.real = nullptr;
    return result;
  }
  // As SQLite has it: what has methods is closed, even if it did not open.
  ours.is_database = (flags & SQLITE_OPEN_MAIN_DB) != 0;
  ours.base.pMethods = &kMethods;
  return result;
}

int Delete(sqlite3_vfs*, const char* path, int sync_folder) {
  return Below()->xDelete(Below(), path, sync_folder);
}
int Access(sqlite3_vfs*, const char* path, int flags, int* result) {
  return Below()->xAccess(Below(), path, flags, result);
}
int LastError(sqlite3_vfs*, int size, char* text) {
  return Below()->xGetLastError(Below(), size, text);
}

}  // namespace

const char* CheckedPagesVfs() {
  static const sqlite3_vfs* const vfs = [] {
    // What is not about files is the real one's.
    auto* const shim = new sqlite3_vfs(*Below());
    shim->szOsFile = sizeof(File);
    shim->zName = "fathom-checked-pages";
    shim->pNext = nullptr;
    shim->xOpen = Open;
    shim->xDelete = Delete;
    shim->xAccess = Access;
    shim->xGetLastError = LastError;
    if (sqlite3_vfs_register(shim, /*makeDflt=*/0) != SQLITE_OK) std::abort();
    return shim;
  }();
  return vfs->zName;
}

std::uint32_t PageChecksum(std::uint32_t number, ByteSpan content) {
  // The content's checksum stands for it: no copy.
  const std::uint32_t crc = Crc32c(content);
  std::uint8_t both[8];
  for (int i = 0; i < 4; ++i) {
    both[i] = static_cast<std::uint8_t>(number >> (8 * i));
    both[4 + i] = static_cast<std::uint8_t>(crc >> (8 * i));
  }
  return Crc32c(ByteSpan(both, sizeof(both)));
}

}  // namespace fathom::storage
