#include "storage/column.h"

#include <zstd.h>

#include <algorithm>
#include <bit>
#include <memory>

namespace fathom::storage {
namespace {

static_assert(std::endian::native == std::endian::little,
              "columns are copied from memory; add a byte swap first");

enum PlaneMode : std::uint8_t { kConstant = 0, kRaw = 1, kZstd = 2 };

constexpr int kZstdLevel = 1;

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
    case 16:
      return Split<16>(elements, count, planes);
    default:
      for (std::size_t k = 0; k < width; ++k) {
        for (std::size_t i = 0; i < count; ++i) {
          planes[k * count + i] = elements[i * width + k];
        }
      }
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

void PutPlane(ByteSpan plane, Bytes& scratch, ByteWriter& writer) {
  // memcmp of the plane with itself, shifted by one: all bytes are equal.
  if (std::memcmp(plane.data(), plane.data() + 1, plane.size() - 1) == 0) {
    writer.PutU8(kConstant);
    writer.PutU8(plane[0]);
    return;
  }
  if (plane.size() >= kMinZstdBytes) {
    scratch.resize(ZSTD_compressBound(plane.size()));
    const std::size_t size =
        ZSTD_compressCCtx(CompressionContext(), scratch.data(), scratch.size(),
                          plane.data(), plane.size(), kZstdLevel);
    if (ZSTD_isError(size) == 0 && size + 4 < plane.size()) {
      writer.PutU8(kZstd);
      writer.PutVarint(size);
      writer.PutBytes(ByteSpan(scratch).first(size));
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
  Bytes planes(count * width);
  SplitAny(static_cast<const std::uint8_t*>(elements), count, width,
           planes.data());
  Bytes scratch;
  for (std::size_t k = 0; k < width; ++k) {
    PutPlane(ByteSpan(planes).subspan(k * count, count), scratch, writer);
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
  Bytes planes(rows.size());
  SplitAny(rows.data(), rows.size() / width, width, planes.data());
  Bytes scratch;
  PutPlane(planes, scratch, writer);
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
