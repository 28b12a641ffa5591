// Makes SQLite's n-th request for memory fail. Our own code's memory is not
// concerned: std::bad_alloc ends the program, and a restart recovers.
//
// One thread at a time.

#ifndef FATHOM_TESTS_FAULT_MEMORY_FAULT_H_
#define FATHOM_TESTS_FAULT_MEMORY_FAULT_H_

#include <cstdint>

namespace fathom::fault {

// Before SQLite is used for the first time. Also takes away its small reserve
// (lookaside), so that each request counts.
void InstallMemoryFault();

void FailMemoryAt(std::uint64_t n, bool for_good);
void HealMemory();
bool MemoryHasFailed();

}  // namespace fathom::fault

#endif  // FATHOM_TESTS_FAULT_MEMORY_FAULT_H_
