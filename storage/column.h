// Columns: how arrays of numbers are laid into a blob, lossless and small.
//
// Depths, ranges and times of neighbours share their high bytes and differ in
// their low ones. So an array of n elements of w bytes is written as w planes
// (plane k holds byte k, least significant first, of every element) and each
// plane by itself in the cheapest of three modes:
//
//   0 constant  one byte follows: every byte of the plane
//   1 raw       n bytes follow
//   2 zstd      varint size, then one zstd frame of n bytes
//
// An empty column is zero bytes long. Planes are coded apart because zstd
// shares one literal code among all that lies within 128 KiB: a noise plane
// would spoil its neighbours. A plane below kMinZstdBytes is never tried.
// The count n is not part of the column: the caller writes it, and bounds it
// when it reads, before a hostile count can claim memory.

#ifndef FATHOM_STORAGE_COLUMN_H_
#define FATHOM_STORAGE_COLUMN_H_

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "storage/bytes.h"

namespace fathom::storage {

// Below this a zstd frame's own bytes (near 12) outweigh what it saves.
inline constexpr std::size_t kMinZstdBytes = 48;

// `count` elements of `width` bytes, in the order of memory, at `elements`:
// numbers, or records of numbers without padding. Little-endian machines only
// (checked when compiled).
void PutColumnBytes(const void* elements, std::size_t count, std::size_t width,
                    ByteWriter& writer);
// Fills `elements`; on failure the reader is failed and the content undefined.
void GetColumnBytes(ByteReader& reader, std::size_t count, std::size_t width,
                    void* elements);

// Records of `width` bytes each, row after row, in one plane: byte 0 of all
// rows, then byte 1, and so on. For short tables of wide rows, where a frame
// for each byte would cost more than it saves. Compressed in haste.
void PutRows(ByteSpan rows, std::size_t width, ByteWriter& writer);
// Empty if the reader is or becomes failed.
Bytes GetRows(ByteReader& reader, std::size_t count, std::size_t width);

template <typename T>
concept ColumnElement = (std::is_arithmetic_v<T> && sizeof(T) <= 8) &&
                        !std::is_same_v<T, bool>;

template <ColumnElement T>
void PutColumn(std::span<const T> elements, ByteWriter& writer) {
  PutColumnBytes(elements.data(), elements.size(), sizeof(T), writer);
}
template <ColumnElement T>
void PutColumn(const std::vector<T>& elements, ByteWriter& writer) {
  PutColumn(std::span<const T>(elements), writer);
}

// `count` must have been bounded by the caller (ByteReader::GetCount). Empty if
// the reader is or becomes failed.
template <ColumnElement T>
std::vector<T> GetColumn(ByteReader& reader, std::size_t count) {
  std::vector<T> elements;
  if (!reader.ok()) return elements;
  elements.resize(count);
  GetColumnBytes(reader, count, sizeof(T), elements.data());
  if (!reader.ok()) elements.clear();
  return elements;
}

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_COLUMN_H_
