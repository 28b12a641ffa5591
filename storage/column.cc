#include "storage/column.h"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <memory>
#include <utility>

namespace fathom::storage {
namespace {

static_assert(std::endian::native == std::endian::little,
              "columns are copied from memory; add a byte swap first");

enum PlaneMode : std::uint8_t { kConstant = 0, kRaw = 1, kZstd = 2 };

constexpr int kZstdLevel = 1;
// Of rows that are written while reports stream in: half of a contact's
// estimate is noise, on which the level above spends 3.6 times as long (330
// against 90 ns an estimate) for 4 % less (96 against 99.5 of 242 bytes).
constexpr int kRowsZstdLevel = -10;

// zstd's contexts take 100 us to make and microseconds to reuse; one a thread.
struct ContextDeleter {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

ZSTD_CCtx* CompressionContext() {
  thread_local const std::unique_ptr<ZSTD_CCtx, ContextDeleter> context(
      ZSTD_createCCtx());
  return context.get();
}

ZSTD_DCtx* DecompressionContext() {
  thread_local const std::unique_ptr<ZSTD_DCtx, ContextDeleter> context(
      ZSTD_createDCtx());
  return context.get();
}

// Element-major to plane-major and back, with the width known to the compiler.
template <std::size_t kWidth>
void Split(const std::uint8_t* elements, std::size_t count,
           std::uint8_t* planes) {
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < kWidth; ++k) {
      planes[k * count + i] = elements[i * kWidth + k];
    }
  }
}

template <std::size_t kWidth>
void Join(const std::uint8_t* planes, std::size_t count,
          std::uint8_t* elements) {
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < kWidth; ++k) {
      elements[i * kWidth + k] = planes[k * count + i];
    }
  }
}

// Sixteen bytes that the compiler keeps in one register.
constexpr std::size_t kVector = 16;
using Vector = std::uint8_t __attribute__((vector_size(kVector)));

using Square = std::array<Vector, kVector>;

// Rows i and i + 8 interleaved. (A loop over i would stay one at -O2.)
template <std::size_t... i>
Square Interleave(const Square& rows, std::index_sequence<i...>) {
  Square next;
  ((next[2 * i] =
        __builtin_shufflevector(rows[i], rows[i + sizeof...(i)], 0, 16, 1, 17,
                                2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23),
    next[2 * i + 1] = __builtin_shufflevector(rows[i], rows[i + sizeof...(i)],
                                              8, 24, 9, 25, 10, 26, 11, 27, 12,
                                              28, 13, 29, 14, 30, 15, 31)),
   ...);
  return next;
}

// The square transposed: four interleavings turn each row into a column (they
// rotate the eight bits of (row, column) by one place each).
Square Transpose(const Square& rows) {
  constexpr std::make_index_sequence<kVector / 2> kHalf;
  return Interleave(
      Interleave(Interleave(Interleave(rows, kHalf), kHalf), kHalf), kHalf);
}

// Sixteen elements of any width at a time, a tenth of the instructions of byte
// after byte: squares of sixteen bytes, then what is left of the width and of
// the count.
void SplitSquares(const std::uint8_t* elements, std::size_t count,
                  std::size_t width, std::uint8_t* planes) {
  const std::size_t squares = count / kVector * kVector;
  Square square;
  std::size_t k = 0;
  for (; k + kVector <= width; k += kVector) {
    for (std::size_t i = 0; i < squares; i += kVector) {
      if (width == kVector) {
        std::memcpy(&square, elements + i * kVector, sizeof(square));
      } else {
        for (std::size_t j = 0; j < kVector; ++j) {
          std::memcpy(&square[j], elements + (i + j) * width + k, kVector);
        }
      }
      square = Transpose(square);
      for (std::size_t j = 0; j < kVector; ++j) {
        std::memcpy(planes + (k + j) * count + i, &square[j], kVector);
      }
    }
  }
  for (std::size_t column = 0; column < width; ++column) {
    for (std::size_t i = column < k ? squares : 0; i < count; ++i) {
      planes[column * count + i] = elements[i * width + column];
    }
  }
}

// Width 16, every beam of the journal.
template <>
void Join<kVector>(const std::uint8_t* planes, std::size_t count,
                   std::uint8_t* elements) {
  Square square;
  std::size_t i = 0;
  for (; i + kVector <= count; i += kVector) {
    for (std::size_t k = 0; k < kVector; ++k) {
      std::memcpy(&square[k], planes + k * count + i, kVector);
    }
    square = Transpose(square);
    std::memcpy(elements + i * kVector, &square, sizeof(square));
  }
  for (; i < count; ++i) {
    for (std::size_t k = 0; k < kVector; ++k) {
      elements[i * kVector + k] = planes[k * count + i];
    }
  }
}

// The low and the high half of two registers, byte by byte.
Vector LowBytes(Vector a, Vector b) {
  return __builtin_shufflevector(a, b, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21,
                                 6, 22, 7, 23);
}
Vector HighBytes(Vector a, Vector b) {
  return __builtin_shufflevector(a, b, 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13,
                                 29, 14, 30, 15, 31);
}

// Width 4, depths and times of tiles: a quarter of a start was byte after byte.
template <>
void Join<4>(const std::uint8_t* planes, std::size_t count,
             std::uint8_t* elements) {
  std::size_t i = 0;
  for (; i + kVector <= count; i += kVector) {
    Vector plane[4];
    for (std::size_t k = 0; k < 4; ++k) {
      std::memcpy(&plane[k], planes + k * count + i, kVector);
    }
    const Vector even_low = LowBytes(plane[0], plane[2]);
    const Vector even_high = HighBytes(plane[0], plane[2]);
    const Vector odd_low = LowBytes(plane[1], plane[3]);
    const Vector odd_high = HighBytes(plane[1], plane[3]);
    const Vector joined[4] = {
        LowBytes(even_low, odd_low), HighBytes(even_low, odd_low),
        LowBytes(even_high, odd_high), HighBytes(even_high, odd_high)};
    std::memcpy(elements + 4 * i, joined, sizeof(joined));
  }
  for (; i < count; ++i) {
    for (std::size_t k = 0; k < 4; ++k) {
      elements[i * 4 + k] = planes[k * count + i];
    }
  }
}

// Memory that is written before it is read: not zeroed.
class Scratch {
 public:
  explicit Scratch(std::size_t size)
      : size_(size), bytes_(new std::uint8_t[size]) {}
  std::uint8_t* data() { return bytes_.get(); }
  std::size_t size() const { return size_; }
  ByteSpan span() const { return ByteSpan(bytes_.get(), size_); }

 private:
  std::size_t size_;
  std::unique_ptr<std::uint8_t[]> bytes_;
};

void SplitAny(const std::uint8_t* elements, std::size_t count,
              std::size_t width, std::uint8_t* planes) {
  switch (width) {
    case 1:
      return Split<1>(elements, count, planes);
    case 2:
      return Split<2>(elements, count, planes);
    case 4:
      return Split<4>(elements, count, planes);
    case 8:
      return Split<8>(elements, count, planes);
    default:
      return SplitSquares(elements, count, width, planes);
  }
}

void JoinAny(const std::uint8_t* planes, std::size_t count, std::size_t width,
             std::uint8_t* elements) {
  switch (width) {
    case 1:
      return Join<1>(planes, count, elements);
    case 2:
      return Join<2>(planes, count, elements);
    case 4:
      return Join<4>(planes, count, elements);
    case 8:
      return Join<8>(planes, count, elements);
    case 16:
      return Join<16>(planes, count, elements);
    default:
      for (std::size_t k = 0; k < width; ++k) {
        for (std::size_t i = 0; i < count; ++i) {
          elements[i * width + k] = planes[k * count + i];
        }
      }
  }
}

// `scratch` holds ZSTD_compressBound(plane.size()).
void PutPlane(ByteSpan plane, int level, Scratch& scratch, ByteWriter& writer) {
  // memcmp of the plane with itself, shifted by one: all bytes are equal.
  if (std::memcmp(plane.data(), plane.data() + 1, plane.size() - 1) == 0) {
    writer.PutU8(kConstant);
    writer.PutU8(plane[0]);
    return;
  }
  if (plane.size() >= kMinZstdBytes) {
    const std::size_t size =
        ZSTD_compressCCtx(CompressionContext(), scratch.data(), scratch.size(),
                          plane.data(), plane.size(), level);
    if (ZSTD_isError(size) == 0 && size + 4 < plane.size()) {
      writer.PutU8(kZstd);
      writer.PutVarint(size);
      writer.PutBytes(scratch.span().first(size));
      return;
    }
  }
  writer.PutU8(kRaw);
  writer.PutBytes(plane);
}

void GetPlane(ByteReader& reader, std::span<std::uint8_t> plane) {
  switch (reader.GetU8()) {
    case kConstant:
      std::fill(plane.begin(), plane.end(), reader.GetU8());
      return;
    case kRaw: {
      const ByteSpan raw = reader.GetBytes(plane.size());
      std::copy(raw.begin(), raw.end(), plane.begin());
      return;
    }
    case kZstd: {
      const ByteSpan frame = reader.GetBytes(reader.GetCount(reader.left()));
      const std::size_t size =
          ZSTD_decompressDCtx(DecompressionContext(), plane.data(),
                              plane.size(), frame.data(), frame.size());
      // An error code is larger than any plane.
      if (size != plane.size()) reader.Fail();
      return;
    }
    default:
      reader.Fail();
  }
}

}  // namespace

void PutColumnBytes(const void* elements, std::size_t count, std::size_t width,
                    ByteWriter& writer) {
  if (count == 0) return;
  Scratch planes(count * width);
  SplitAny(static_cast<const std::uint8_t*>(elements), count, width,
           planes.data());
  Scratch scratch(ZSTD_compressBound(count));
  for (std::size_t k = 0; k < width; ++k) {
    PutPlane(planes.span().subspan(k * count, count), kZstdLevel, scratch,
             writer);
  }
}

void GetColumnBytes(ByteReader& reader, std::size_t count, std::size_t width,
                    void* elements) {
  if (count == 0) return;
  Bytes planes(count * width);
  for (std::size_t k = 0; k < width && reader.ok(); ++k) {
    GetPlane(reader, std::span(planes).subspan(k * count, count));
  }
  if (!reader.ok()) return;
  JoinAny(planes.data(), count, width, static_cast<std::uint8_t*>(elements));
}

void PutRows(ByteSpan rows, std::size_t width, ByteWriter& writer) {
  if (rows.empty()) return;
  Scratch planes(rows.size());
  SplitAny(rows.data(), rows.size() / width, width, planes.data());
  Scratch scratch(ZSTD_compressBound(rows.size()));
  PutPlane(planes.span(), kRowsZstdLevel, scratch, writer);
}

Bytes GetRows(ByteReader& reader, std::size_t count, std::size_t width) {
  if (!reader.ok() || count == 0) return {};
  Bytes planes(count * width);
  GetPlane(reader, planes);
  if (!reader.ok()) return {};
  Bytes rows(planes.size());
  JoinAny(planes.data(), count, width, rows.data());
  return rows;
}

}  // namespace fathom::storage
