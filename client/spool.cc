#include "client/spool.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/crc32c.h"
#include "base/status_macros.h"

namespace fathom::client {
namespace {

constexpr std::string_view kMagic = "FTHMSPL2";
constexpr std::string_view kMagicWithoutMarks = "FTHMSPL1";
constexpr std::size_t kSourceBytes = 64;
constexpr std::size_t kHeaderBytes = 8 + 8 + 8 + kSourceBytes + 4;
constexpr std::size_t kFrameBytes = 8;
// No count of messages reaches it.
constexpr std::uint64_t kMostSequence = std::uint64_t{1} << 63;
// In place of a size.
constexpr std::uint32_t kMarkWord = 0xFFFFFFFF;
constexpr std::size_t kMarkBytes = kFrameBytes + 8;
// A segment is an eighth of the whole, at most this: small enough that room
// comes back soon, large enough that files are few.
constexpr std::uint64_t kMostSegmentBytes = 8u << 20;
// Of a file that is there: marks once went beyond.
constexpr std::uint64_t kMostFileBytes = kMostSegmentBytes + 4 * kMarkBytes;
constexpr std::size_t kReadBytes = 1u << 18;

template <typename Word>
void PutWord(Word value, char* out) {
  for (std::size_t i = 0; i < sizeof value; ++i) {
    out[i] = static_cast<char>(value >> (8 * i));
  }
}

template <typename Word>
Word GetWord(const char* in) {
  Word value = 0;
  for (std::size_t i = 0; i < sizeof value; ++i) {
    value |= static_cast<Word>(
        static_cast<Word>(static_cast<unsigned char>(in[i])) << (8 * i));
  }
  return value;
}

std::uint32_t Crc(std::string_view bytes) {
  return Crc32c(
      {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

absl::Status DiskError(const std::string& what, const std::string& path) {
  const std::string text = absl::StrFormat(
      "cannot %s %s: %s", what, path, std::generic_category().message(errno));
  switch (errno) {
    case ENOSPC:
    case EDQUOT:
      return absl::ResourceExhaustedError(text);
    case EACCES:
    case EPERM:
    case EROFS:
    case ENOTDIR:
      return absl::PermissionDeniedError(text);
    default:
      return absl::DataLossError(text);
  }
}

absl::Status Damaged(const std::string& path, std::uint64_t offset) {
  return absl::DataLossError(absl::StrFormat(
      "%s is damaged at byte %d; it was not changed", path, offset));
}

bool WriteWhole(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

// Appends up to `size` bytes of the file from `offset`; fewer at its end.
bool ReadMore(int file, std::uint64_t offset, std::size_t size,
              std::string& bytes) {
  const std::size_t before = bytes.size();
  bytes.resize(before + size);
  std::size_t got = 0;
  while (got < size) {
    const ssize_t read = ::pread(file, bytes.data() + before + got, size - got,
                                 static_cast<off_t>(offset + got));
    if (read < 0 && errno == EINTR) continue;
    if (read < 0) return false;
    if (read == 0) break;
    got += static_cast<std::size_t>(read);
  }
  bytes.resize(before + got);
  return true;
}

// Names made and removed in the folder are on disk.
absl::Status SyncFolder(const std::string& folder) {
  const int file = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file < 0) return DiskError("open", folder);
  const bool synced = ::fsync(file) == 0;
  ::close(file);
  return synced ? absl::OkStatus() : DiskError("sync", folder);
}

// Makes the folder and those above it, on disk too.
absl::Status MakeFolder(const std::filesystem::path& folder) {
  std::error_code error;
  if (folder.empty() || std::filesystem::is_directory(folder, error)) {
    return absl::OkStatus();
  }
  const std::filesystem::path parent = folder.parent_path();
  FATHOM_RETURN_IF_ERROR(MakeFolder(parent));
  if (!std::filesystem::create_directory(folder, error)) {
    // "a/" was made as "a".
    if (!error) return absl::OkStatus();
    return absl::PermissionDeniedError(absl::StrFormat(
        "cannot make the folder %s: %s", folder.string(), error.message()));
  }
  return SyncFolder(parent.empty() ? "." : parent.string());
}

struct Header {
  std::uint64_t epoch;
  std::uint64_t first;
  std::string source_id;
  bool has_marks = true;
};

std::string Encode(const Header& header) {
  std::string bytes(kHeaderBytes, '\0');
  kMagic.copy(bytes.data(), kMagic.size());
  PutWord(header.epoch, bytes.data() + 8);
  PutWord(header.first, bytes.data() + 16);
  header.source_id.copy(bytes.data() + 24, kSourceBytes);
  PutWord(Crc(std::string_view(bytes).substr(0, kHeaderBytes - 4)),
          bytes.data() + kHeaderBytes - 4);
  return bytes;
}

std::optional<Header> DecodeHeader(std::string_view bytes) {
  const bool has_marks = bytes.starts_with(kMagic);
  if (bytes.size() < kHeaderBytes ||
      !(has_marks || bytes.starts_with(kMagicWithoutMarks)) ||
      Crc(bytes.substr(0, kHeaderBytes - 4)) !=
          GetWord<std::uint32_t>(bytes.data() + kHeaderBytes - 4)) {
    return std::nullopt;
  }
  const std::string_view source = bytes.substr(24, kSourceBytes);
  Header header = {
      .epoch = GetWord<std::uint64_t>(bytes.data() + 8),
      .first = GetWord<std::uint64_t>(bytes.data() + 16),
      .source_id = std::string(source.substr(0, source.find('\0'))),
      .has_marks = has_marks};
  if (header.epoch == 0 || header.first == 0 || header.first > kMostSequence ||
      header.source_id.empty()) {
    return std::nullopt;
  }
  return header;
}

std::string SegmentName(const std::string& kind, std::uint64_t first) {
  return absl::StrFormat("/%s-%020d.spool", kind, first);
}

// Whether the file is what a power cut leaves of a segment's making: a part of
// its header, or zeros in its place.
bool IsCutShort(const std::string& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (size != kHeaderBytes) return size < kHeaderBytes;
  std::string bytes(kHeaderBytes, '?');
  std::ifstream(path, std::ios::binary).read(bytes.data(), kHeaderBytes);
  return bytes.find_first_not_of('\0') == std::string::npos;
}

absl::Status NothingThere(const SpoolOptions& options) {
  return absl::NotFoundError(absl::StrFormat(
      "the folder %s holds no buffered %s", options.folder, options.kind));
}

std::string Framed(std::uint32_t size_word, std::string_view content) {
  std::string frame(kFrameBytes, '\0');
  PutWord(size_word, frame.data());
  PutWord(Crc(content), frame.data() + 4);
  return frame.append(content);
}

std::string EncodeMark(std::uint64_t synced_bytes) {
  std::string content(8, '\0');
  PutWord(synced_bytes, content.data());
  return Framed(kMarkWord, content);
}

// What stands at the head of `bytes`, and the size of its content.
enum class Frame { kWhole, kMark, kShort, kDamaged };
Frame LookAtFrame(std::string_view bytes, std::size_t& size) {
  if (bytes.size() < kFrameBytes) return Frame::kShort;
  size = GetWord<std::uint32_t>(bytes.data());
  if (size == 0) return Frame::kDamaged;
  const bool is_mark = size == kMarkWord;
  if (is_mark) size = kMarkBytes - kFrameBytes;
  if (bytes.size() < kFrameBytes + size) return Frame::kShort;
  if (Crc(bytes.substr(kFrameBytes, size)) !=
      GetWord<std::uint32_t>(bytes.data() + 4)) {
    return Frame::kDamaged;
  }
  return is_mark ? Frame::kMark : Frame::kWhole;
}

// Whether a mark in `bytes` says that more than `offset` of the file was
// synced.
bool WasSynced(std::string_view bytes, std::uint64_t offset) {
  for (; bytes.size() >= kMarkBytes; bytes.remove_prefix(1)) {
    if (GetWord<std::uint32_t>(bytes.data()) != kMarkWord) continue;
    std::size_t ignored = 0;
    if (LookAtFrame(bytes, ignored) == Frame::kMark &&
        GetWord<std::uint64_t>(bytes.data() + kFrameBytes) > offset) {
      return true;
    }
  }
  return false;
}

// Whether these bytes at the end of a last segment without marks, which begin
// with no whole message, are all that is left of one: at most zeros are behind
// it (a power cut that spared the file's size), and no whole message in it (a
// size that was damaged).
bool IsTornEnd(std::string_view bytes) {
  // npos + 1 is 0.
  const std::size_t used = bytes.find_last_not_of('\0') + 1;
  if (used <= kFrameBytes) return true;
  const std::size_t size = GetWord<std::uint32_t>(bytes.data());
  if (size > kMostSpoolMessageBytes || used > kFrameBytes + size) return false;
  for (; !bytes.empty(); bytes.remove_prefix(1)) {
    std::size_t ignored = 0;
    if (LookAtFrame(bytes, ignored) == Frame::kWhole) return false;
  }
  return true;
}

}  // namespace

Spool::Spool(const SpoolOptions& options)
    : options_(options),
      segment_bytes_(std::min(options.max_bytes / 8, kMostSegmentBytes)),
      source_id_(options.source_id),
      epoch_(options.epoch) {}

Spool::~Spool() {
  for (const int file : {append_, read_, lock_}) {
    if (file >= 0) ::close(file);
  }
}

absl::StatusOr<std::unique_ptr<Spool>> Spool::Open(
    const SpoolOptions& options) {
  if (options.max_bytes < kLeastSpoolBytes) {
    return absl::InvalidArgumentError(
        absl::StrFormat("max_bytes=%d of a buffer must be at least %d",
                        options.max_bytes, kLeastSpoolBytes));
  }
  if (options.source_id.size() > kSourceBytes) {
    return absl::InvalidArgumentError(
        absl::StrFormat("source_id=\"%s\": at most %d characters",
                        options.source_id, kSourceBytes));
  }
  std::error_code error;
  if (options.source_id.empty() &&
      !std::filesystem::is_directory(options.folder, error)) {
    return NothingThere(options);
  }
  FATHOM_RETURN_IF_ERROR(MakeFolder(options.folder));
  std::unique_ptr<Spool> spool(new Spool(options));
  FATHOM_RETURN_IF_ERROR(spool->Lock());
  FATHOM_RETURN_IF_ERROR(spool->OpenSegments());
  spool->next_read_ = spool->first_sequence();
  return spool;
}

absl::Status Spool::Lock() {
  const std::string path = options_.folder + "/" + options_.kind + ".lock";
  lock_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (lock_ < 0) return DiskError("open", path);
  if (::flock(lock_, LOCK_EX | LOCK_NB) != 0) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "the buffer %s is in use by another process", options_.folder));
  }
  return absl::OkStatus();
}

absl::Status Spool::OpenSegments() {
  std::vector<std::string> paths;
  std::error_code error;
  std::filesystem::directory_iterator entry(options_.folder, error);
  for (; !error && entry != std::filesystem::directory_iterator();
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with(options_.kind + "-") && name.ends_with(".spool")) {
      paths.push_back(entry->path().string());
    }
  }
  if (error) {
    return absl::DataLossError(absl::StrFormat(
        "cannot read the folder %s: %s", options_.folder, error.message()));
  }
  // Numbers of 20 digits: in order of name is in order of number.
  std::sort(paths.begin(), paths.end());
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const bool last = i + 1 == paths.size();
    if (last && IsCutShort(paths[i])) {
      // Its header was synced before anything was taken into it: nothing was.
      if (::unlink(paths[i].c_str()) != 0) return DiskError("remove", paths[i]);
      continue;
    }
    Segment segment{.path = paths[i]};
    FATHOM_RETURN_IF_ERROR(Scan(segment, last));
    if (!segments_.empty() && segment.first != segments_.back().end()) {
      return absl::DataLossError(absl::StrFormat(
          "%s begins with message %d, the one before it ends with %d",
          segment.path, segment.first, segments_.back().end() - 1));
    }
    bytes_ += segment.bytes;
    segments_.push_back(std::move(segment));
  }
  if (segments_.empty()) {
    if (source_id_.empty()) return NothingThere(options_);
    return StartSegment(1);
  }
  const std::string& path = segments_.back().path;
  append_ = ::open(path.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  if (append_ < 0) return DiskError("open", path);
  if (::ftruncate(append_, static_cast<off_t>(segments_.back().bytes)) != 0) {
    return DiskError("cut off the torn end of", path);
  }
  // Who wrote it may have been killed before it synced.
  FATHOM_RETURN_IF_ERROR(NoteSync(segments_.back(), ::fdatasync(append_) == 0));
  return SyncFolder(options_.folder);
}

absl::Status Spool::Scan(Segment& segment, bool last) {
  const int file = ::open(segment.path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return DiskError("open", segment.path);
  std::string bytes;
  std::error_code error;
  const std::uint64_t file_bytes = std::min<std::uint64_t>(
      std::filesystem::file_size(segment.path, error), kMostFileBytes + 1);
  const absl::Status status = ReadMore(file, 0, file_bytes, bytes)
                                  ? absl::OkStatus()
                                  : DiskError("read", segment.path);
  ::close(file);
  FATHOM_RETURN_IF_ERROR(status);
  if (file_bytes > kMostFileBytes) return Damaged(segment.path, kMostFileBytes);
  const std::optional<Header> header = DecodeHeader(bytes);
  // Under another number it may stand where the next segment is to be.
  if (!header.has_value() ||
      !segment.path.ends_with(SegmentName(options_.kind, header->first))) {
    return Damaged(segment.path, 0);
  }
  if (source_id_.empty()) source_id_ = header->source_id;
  if (header->source_id != source_id_) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the buffer %s holds messages of source \"%s\", not of \"%s\"",
        options_.folder, header->source_id, source_id_));
  }
  epoch_ = header->epoch;
  segment.first = header->first;
  segment.bytes = kHeaderBytes;
  segment.has_marks = header->has_marks;
  while (segment.bytes < bytes.size()) {
    std::size_t size = 0;
    const std::string_view rest = std::string_view(bytes).substr(segment.bytes);
    const Frame frame = LookAtFrame(rest, size);
    if (frame == Frame::kWhole || frame == Frame::kMark) {
      segment.is_marked =
          frame == Frame::kMark &&
          GetWord<std::uint64_t>(rest.data() + kFrameBytes) == segment.bytes;
      segment.bytes += kFrameBytes + size;
      segment.count += frame == Frame::kWhole ? 1 : 0;
      continue;
    }
    const bool torn =
        segment.has_marks ? !WasSynced(rest, segment.bytes) : IsTornEnd(rest);
    return last && torn ? absl::OkStatus()
                        : Damaged(segment.path, segment.bytes);
  }
  return absl::OkStatus();
}

absl::Status Spool::StartSegment(std::uint64_t first) {
  FATHOM_RETURN_IF_ERROR(broken_);
  // Also a mark alone: in a segment that is not the last nothing may be torn,
  // so none is set after this sync.
  if (append_ >= 0 && ::fdatasync(append_) != 0) {
    return NoteSync(segments_.back(), false);
  }
  Segment segment{.path = options_.folder + SegmentName(options_.kind, first),
                  .first = first,
                  .bytes = kHeaderBytes};
  const int file =
      ::open(segment.path.c_str(),
             O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644);
  if (file < 0) return DiskError("make", segment.path);
  absl::Status status;
  if (!WriteWhole(
          file,
          Encode({.epoch = epoch_, .first = first, .source_id = source_id_})) ||
      ::fsync(file) != 0) {
    status = DiskError("write", segment.path);
  }
  if (status.ok()) status = SyncFolder(options_.folder);
  if (!status.ok()) {
    ::close(file);
    ::unlink(segment.path.c_str());
    return status;
  }
  if (append_ >= 0) ::close(append_);
  append_ = file;
  synced_ = first - 1;
  bytes_ += segment.bytes;
  segments_.push_back(std::move(segment));
  return absl::OkStatus();
}

bool Spool::HasRoom(std::size_t message_bytes) const {
  // With a mark and the headers of two segments: one for the message, one for
  // when the server has it.
  constexpr std::size_t kAround = 2 * kHeaderBytes + kFrameBytes + kMarkBytes;
  return bytes_ + kAround + message_bytes <= options_.max_bytes;
}

absl::Status Spool::Append(std::string_view message) {
  FATHOM_RETURN_IF_ERROR(broken_);
  if (!HasRoom(message.size())) {
    return absl::ResourceExhaustedError(
        absl::StrFormat("the buffer %s is full: %d of %d bytes",
                        options_.folder, bytes_, options_.max_bytes));
  }
  if (segments_.back().count > 0 &&
      segments_.back().bytes + kFrameBytes + message.size() + kMarkBytes >
          segment_bytes_) {
    FATHOM_RETURN_IF_ERROR(StartSegment(segments_.back().end()));
  }
  const std::string frame =
      Framed(static_cast<std::uint32_t>(message.size()), message);
  Segment& segment = segments_.back();
  if (!WriteWhole(append_, frame)) {
    absl::Status status = DiskError("write", segment.path);
    // No half message may stand before the next one.
    if (::ftruncate(append_, static_cast<off_t>(segment.bytes)) != 0) {
      broken_ = absl::DataLossError(status.message());
      return broken_;
    }
    return status;
  }
  segment.bytes += frame.size();
  segment.is_marked = false;
  bytes_ += frame.size();
  ++segment.count;
  return absl::OkStatus();
}

absl::StatusOr<bool> Spool::Read(std::string& message) {
  if (next_read_ > last_sequence()) return false;
  // The last one that begins at or before it.
  const auto segment = std::prev(std::upper_bound(
      segments_.begin(), segments_.end(), next_read_,
      [](std::uint64_t number, const Segment& s) { return number < s.first; }));
  if (read_ < 0 || read_first_ != segment->first) {
    if (read_ >= 0) ::close(read_);
    read_ = ::open(segment->path.c_str(), O_RDONLY | O_CLOEXEC);
    if (read_ < 0) return DiskError("open", segment->path);
    read_first_ = segment->first;
    read_offset_ = kHeaderBytes;
    ahead_.clear();
    ahead_used_ = 0;
  }
  for (;;) {
    std::size_t size = 0;
    const std::string_view rest = std::string_view(ahead_).substr(ahead_used_);
    const Frame frame = LookAtFrame(rest, size);
    if (frame == Frame::kWhole) {
      message.assign(rest.substr(kFrameBytes, size));
      ahead_used_ += kFrameBytes + size;
      ++next_read_;
      return true;
    }
    if (frame == Frame::kMark) {
      ahead_used_ += kMarkBytes;
      continue;
    }
    if (frame == Frame::kDamaged || read_offset_ >= segment->bytes) {
      return Damaged(segment->path, read_offset_ - rest.size());
    }
    ahead_.erase(0, ahead_used_);
    ahead_used_ = 0;
    const std::size_t before = ahead_.size();
    // Up to what Append has written whole.
    if (!ReadMore(read_, read_offset_,
                  std::min<std::uint64_t>(kReadBytes + size,
                                          segment->bytes - read_offset_),
                  ahead_)) {
      return DiskError("read", segment->path);
    }
    if (ahead_.size() == before) return Damaged(segment->path, read_offset_);
    read_offset_ += ahead_.size() - before;
  }
}

absl::Status Spool::Release(std::uint64_t sequence) {
  const Segment& growing = segments_.back();
  // A new one costs syncs: not for a few messages.
  if (sequence + 1 >= growing.end() && growing.bytes >= segment_bytes_ / 2) {
    FATHOM_RETURN_IF_ERROR(StartSegment(growing.end()));
  }
  while (segments_.size() > 1 && segments_.front().end() <= sequence + 1) {
    if (::unlink(segments_.front().path.c_str()) != 0) {
      return DiskError("remove", segments_.front().path);
    }
    bytes_ -= segments_.front().bytes;
    segments_.pop_front();
    // Or a power cut brings back this one without the next.
    FATHOM_RETURN_IF_ERROR(SyncFolder(options_.folder));
  }
  next_read_ = std::max(next_read_, first_sequence());
  return absl::OkStatus();
}

absl::Status Spool::Clear() {
  if (segments_.back().count > 0) {
    FATHOM_RETURN_IF_ERROR(StartSegment(segments_.back().end()));
  }
  return Release(last_sequence());
}

absl::Status Spool::Sync() {
  if (!broken_.ok() || synced_ == last_sequence()) return broken_;
  return NoteSync(segments_.back(), ::fdatasync(append_) == 0);
}

absl::Status Spool::SyncUnlocked(Mutex& mutex) {
  if (!broken_.ok() || synced_ == last_sequence()) return broken_;
  const Segment segment = segments_.back();
  // Of our own: an Append may close append_ meanwhile.
  const int file = ::fcntl(append_, F_DUPFD_CLOEXEC, 0);
  mutex.Unlock();
  const bool ok = file >= 0 && ::fdatasync(file) == 0;
  const int error = errno;
  if (file >= 0) ::close(file);
  mutex.Lock();
  errno = error;
  return NoteSync(segment, ok);
}

absl::Status Spool::NoteSync(const Segment& synced, bool ok) {
  if (!ok) {
    if (broken_.ok()) {
      broken_ = absl::DataLossError(DiskError("sync", synced.path).message());
    }
    return broken_;
  }
  synced_ = std::max(synced_, synced.end() - 1);
  Segment& growing = segments_.back();
  if (!growing.has_marks || growing.first != synced.first ||
      synced.count == 0 || synced.is_marked ||
      growing.bytes + kMarkBytes > kMostSegmentBytes ||
      bytes_ + kMarkBytes + kHeaderBytes > options_.max_bytes) {
    return broken_;
  }
  // Not synced itself: a process that dies leaves it, a power cut costs at most
  // that damage of the last messages is taken for its own.
  if (WriteWhole(append_, EncodeMark(synced.bytes))) {
    growing.is_marked = synced.bytes == growing.bytes;
    growing.bytes += kMarkBytes;
    bytes_ += kMarkBytes;
  } else if (::ftruncate(append_, static_cast<off_t>(growing.bytes)) != 0) {
    broken_ = absl::DataLossError(DiskError("write", growing.path).message());
  }
  return broken_;
}

}  // namespace fathom::client
