// CRC-32C (Castagnoli): the checksum of what we write to disk.
//
// Polynomial 0x1EDC6F41, reflected in and out, start and final XOR
// 0xFFFFFFFF: RFC 3720 section 12.1; the check value of "123456789" is
// 0xE3069283. It finds every burst of up to 32 bits and every odd count of
// flipped bits.

#ifndef FATHOM_BASE_CRC32C_H_
#define FATHOM_BASE_CRC32C_H_

#include <cstdint>
#include <span>

namespace fathom {

// The CRC-32C of `bytes`. Eight bytes a step from tables (Sarwate 1988,
// Kounavis and Berry 2005). Thread-safe.
std::uint32_t Crc32c(std::span<const std::uint8_t> bytes);

}  // namespace fathom

#endif  // FATHOM_BASE_CRC32C_H_
