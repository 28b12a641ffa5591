// Pages that know when they are damaged: a layer between SQLite and the disk
// that keeps a checksum in the last kPageChecksumBytes of every page of a
// database file.
//
// SQLite's own format finds what breaks a page's structure; a flipped bit in a
// number, a page that took another's place or a page of an earlier time it
// takes for truth. The checksum is the CRC-32C of eight bytes, little-endian:
// the page's number and the CRC-32C of its content; so a page in the wrong
// place fails too. It is computed when a page is written into the file and
// compared when one is read from it; the write-ahead log has SQLite's own
// checksums. A page that fails is SQLITE_IOERR_DATA: DATA_LOSS in sqlite.h. A
// page of zeros alone was never written and is let through: no page that says
// anything is all zero.
//
// A file says that its pages are checked by keeping exactly that many bytes
// of each page free (byte 20 of its header); others pass unchanged. Tools that
// only read (sqlite3, GDAL) do not notice. A tool that writes leaves wrong
// checksums behind: it must work on an export.
//
// A VFS shim in the manner of sqlite.org/cksumvfs.html, which Debian's library
// does not carry and whose checksum does not know a page's place. It stands
// before whatever VFS is SQLite's default at the time of opening. Thread-safe
// as SQLite's VFSes are: a file belongs to one connection.

#ifndef FATHOM_STORAGE_CHECKED_PAGES_H_
#define FATHOM_STORAGE_CHECKED_PAGES_H_

#include <cstdint>

#include "storage/bytes.h"

namespace fathom::storage {

inline constexpr int kPageChecksumBytes = 4;

// The user_version of the first missions with checked pages.
inline constexpr int kFirstCheckedVersion = 6;

// sqlite3_file_control: from here on the pages of this file are checked, also
// before its header says so. No argument. (Own codes are above 100.)
inline constexpr int kFileControlCheckPages = 0x4674686D;

// The VFS's name for sqlite3_open_v2; registers it on the first call.
const char* CheckedPagesVfs();

// The checksum of page `number`, from 1; `content` is all of the page but its
// last kPageChecksumBytes.
std::uint32_t PageChecksum(std::uint32_t number, ByteSpan content);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_CHECKED_PAGES_H_
