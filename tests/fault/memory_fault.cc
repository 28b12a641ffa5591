#include "tests/fault/memory_fault.h"

#include <sqlite3.h>

#include <cstdlib>

namespace fathom::fault {
namespace {

sqlite3_mem_methods real;
bool armed = false;
bool stays = false;
std::uint64_t calls = 0;
std::uint64_t fail_at = 0;
std::uint64_t failures = 0;

bool Fails() {
  if (!armed) return false;
  ++calls;
  if (calls < fail_at || (calls > fail_at && !stays)) return false;
  ++failures;
  return true;
}

void* Allocate(int size) { return Fails() ? nullptr : real.xMalloc(size); }
void* Resize(void* memory, int size) {
  return Fails() ? nullptr : real.xRealloc(memory, size);
}

}  // namespace

void InstallMemoryFault() {
  if (sqlite3_config(SQLITE_CONFIG_GETMALLOC, &real) != SQLITE_OK) {
    std::abort();
  }
  sqlite3_mem_methods ours = real;
  ours.xMalloc = Allocate;
  ours.xRealloc = Resize;
  if (sqlite3_config(SQLITE_CONFIG_MALLOC, &ours) != SQLITE_OK ||
      sqlite3_config(SQLITE_CONFIG_LOOKASIDE, 0, 0) != SQLITE_OK) {
    std::abort();
  }
}

void FailMemoryAt(std::uint64_t n, bool for_good) {
  armed = true;
  stays = for_good;
  calls = 0;
  fail_at = n;
  failures = 0;
}

void HealMemory() { armed = false; }
bool MemoryHasFailed() { return failures > 0; }

}  // namespace fathom::fault
