#include "tests/fault/fault_disk.h"

#include <sqlite3.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <utility>

namespace fathom::fault {
namespace {

sqlite3_vfs* real_vfs = nullptr;

// What SQLite holds of an open file; `real` is the real VFS's, behind it.
struct File {
  sqlite3_file base;
  sqlite3_file* real;
  std::string* name;  // Null: not written down.
};

File& Of(sqlite3_file* file) { return *reinterpret_cast<File*>(file); }
sqlite3_file* Real(sqlite3_file* file) { return Of(file).real; }
FaultDisk& Disk() { return FaultDisk::Get(); }

std::string NameOf(const char* path) {
  const char* const slash = std::strrchr(path, '/');
  return slash == nullptr ? path : slash + 1;
}

// The failure of a call: what SQLite is told, and what errno says.
int Fail(int io_error) {
  Disk().set_last_errno(Disk().disk_full() ? ENOSPC : EIO);
  return io_error;
}

int Close(sqlite3_file* file) {
  File& ours = Of(file);
  const int result = ours.real->pMethods != nullptr
                         ? ours.real->pMethods->xClose(ours.real)
                         : SQLITE_OK;
  std::free(ours.real);
  delete ours.name;
  return result;
}

int Read(sqlite3_file* file, void* to, int size, sqlite3_int64 offset) {
  if (Disk().Fails(FaultDisk::Call::kOther)) return Fail(SQLITE_IOERR_READ);
  return Real(file)->pMethods->xRead(Real(file), to, size, offset);
}

int Write(sqlite3_file* file, const void* from, int size,
          sqlite3_int64 offset) {
  const bool fails = Disk().Fails(FaultDisk::Call::kWrite);
  const int written = fails ? size / 2 : size;
  const int result = written == 0 ? SQLITE_OK
                                  : Real(file)->pMethods->xWrite(
                                        Real(file), from, written, offset);
  if (Of(file).name != nullptr && Disk().logging() && written > 0) {
    const auto* bytes = static_cast<const std::uint8_t*>(from);
    Disk().Note({.kind = DiskOperation::Kind::kWrite,
                 .file = *Of(file).name,
                 .offset = offset,
                 .bytes = {bytes, bytes + written}});
  }
  if (fails) {
    return Fail(Disk().disk_full() ? SQLITE_FULL : SQLITE_IOERR_WRITE);
  }
  return result;
}

int Truncate(sqlite3_file* file, sqlite3_int64 size) {
  if (Disk().Fails(FaultDisk::Call::kOther)) {
    return Fail(SQLITE_IOERR_TRUNCATE);
  }
  if (Of(file).name != nullptr) {
    Disk().Note({.kind = DiskOperation::Kind::kTruncate,
                 .file = *Of(file).name,
                 .offset = size});
  }
  return Real(file)->pMethods->xTruncate(Real(file), size);
}

int Sync(sqlite3_file* file, int) {
  if (Disk().Fails(FaultDisk::Call::kOther)) return Fail(SQLITE_IOERR_FSYNC);
  if (Of(file).name != nullptr) {
    Disk().Note({.kind = DiskOperation::Kind::kSync, .file = *Of(file).name});
  }
  // The real disk need not be waited for: what counts is the log.
  return SQLITE_OK;
}

int FileSize(sqlite3_file* file, sqlite3_int64* size) {
  if (Disk().Fails(FaultDisk::Call::kOther)) return Fail(SQLITE_IOERR_FSTAT);
  return Real(file)->pMethods->xFileSize(Real(file), size);
}

int Lock(sqlite3_file* file, int level) {
  return Real(file)->pMethods->xLock(Real(file), level);
}
int Unlock(sqlite3_file* file, int level) {
  return Real(file)->pMethods->xUnlock(Real(file), level);
}
int CheckReservedLock(sqlite3_file* file, int* held) {
  return Real(file)->pMethods->xCheckReservedLock(Real(file), held);
}
int FileControl(sqlite3_file* file, int operation, void* argument) {
  return Real(file)->pMethods->xFileControl(Real(file), operation, argument);
}
int SectorSize(sqlite3_file* file) {
  return Real(file)->pMethods->xSectorSize(Real(file));
}
int Characteristics(sqlite3_file* file) {
  return Real(file)->pMethods->xDeviceCharacteristics(Real(file));
}
int SharedMap(sqlite3_file* file, int region, int size, int extend,
              void volatile** mapped) {
  if (Disk().Fails(extend != 0 ? FaultDisk::Call::kGrowSharedMemory
                               : FaultDisk::Call::kOther)) {
    *mapped = nullptr;
    return Fail(SQLITE_IOERR_SHMMAP);
  }
  return Real(file)->pMethods->xShmMap(Real(file), region, size, extend,
                                       mapped);
}
int SharedLock(sqlite3_file* file, int offset, int count, int flags) {
  return Real(file)->pMethods->xShmLock(Real(file), offset, count, flags);
}
void SharedBarrier(sqlite3_file* file) {
  Real(file)->pMethods->xShmBarrier(Real(file));
}
int SharedUnmap(sqlite3_file* file, int remove) {
  return Real(file)->pMethods->xShmUnmap(Real(file), remove);
}

const sqlite3_io_methods kMethods = {
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
  ours.base.pMethods = nullptr;
  if (Disk().Fails(FaultDisk::Call::kOther)) return Fail(SQLITE_CANTOPEN);
  ours.real = static_cast<sqlite3_file*>(
      std::calloc(1, static_cast<std::size_t>(real_vfs->szOsFile)));
  if (ours.real == nullptr) return SQLITE_NOMEM;
  int exists = 0;
  if (path != nullptr) {
    real_vfs->xAccess(real_vfs, path, SQLITE_ACCESS_EXISTS, &exists);
  }
  const int result =
      real_vfs->xOpen(real_vfs, path, ours.real, flags, out_flags);
  if (result != SQLITE_OK) {
    std::free(ours.real);
    return result;
  }
  ours.name = path != nullptr ? new std::string(NameOf(path)) : nullptr;
  if (ours.name != nullptr && exists == 0) {
    Disk().Note({.kind = DiskOperation::Kind::kCreate, .file = *ours.name});
  }
  ours.base.pMethods = &kMethods;
  return SQLITE_OK;
}

int Delete(sqlite3_vfs*, const char* path, int sync_folder) {
  if (Disk().Fails(FaultDisk::Call::kOther)) return Fail(SQLITE_IOERR_DELETE);
  const int result = real_vfs->xDelete(real_vfs, path, sync_folder);
  if (result == SQLITE_OK) {
    Disk().Note({.kind = DiskOperation::Kind::kDelete, .file = NameOf(path)});
  }
  return result;
}

int Access(sqlite3_vfs*, const char* path, int flags, int* result) {
  if (Disk().Fails(FaultDisk::Call::kOther)) return Fail(SQLITE_IOERR_ACCESS);
  return real_vfs->xAccess(real_vfs, path, flags, result);
}

int LastError(sqlite3_vfs*, int, char*) { return Disk().last_errno(); }

}  // namespace

FaultDisk& FaultDisk::Get() {
  static FaultDisk* const disk = [] {
    real_vfs = sqlite3_vfs_find(nullptr);
    auto* vfs = new sqlite3_vfs(*real_vfs);
    vfs->szOsFile = sizeof(File);
    vfs->zName = "fathom-fault";
    vfs->pNext = nullptr;
    vfs->xOpen = Open;
    vfs->xDelete = Delete;
    vfs->xAccess = Access;
    vfs->xGetLastError = LastError;
    if (sqlite3_vfs_register(vfs, /*makeDflt=*/1) != SQLITE_OK) std::abort();
    return new FaultDisk();
  }();
  return *disk;
}

void FaultDisk::StartLog() {
  log_.clear();
  logging_ = true;
}

void FaultDisk::FailAt(FaultKind kind, std::uint64_t n, bool for_good) {
  kind_ = kind;
  calls_ = 0;
  fail_at_ = n;
  for_good_ = for_good;
  failures_ = 0;
}

bool FaultDisk::Fails(Call call) {
  if (kind_ == FaultKind::kNone) return false;
  if (kind_ == FaultKind::kDiskFull && call == Call::kOther) return false;
  ++calls_;
  if (calls_ < fail_at_ || (calls_ > fail_at_ && !for_good_)) return false;
  ++failures_;
  return true;
}

void FaultDisk::Note(DiskOperation operation) {
  if (logging_) log_.push_back(std::move(operation));
}

}  // namespace fathom::fault
