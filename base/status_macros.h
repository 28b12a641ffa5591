// Early return on errors, for functions that return absl::Status or
// absl::StatusOr<T>. Debian's Abseil (20220623) ships none.
//
//   FATHOM_RETURN_IF_ERROR(store.Open(path));
//   FATHOM_ASSIGN_OR_RETURN(const Tile tile, DecodeTile(bytes));
//
// Both evaluate their expression exactly once and return the status unchanged:
// code, message and payloads. Nothing is logged.

#ifndef FATHOM_BASE_STATUS_MACROS_H_
#define FATHOM_BASE_STATUS_MACROS_H_

#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

// Returns the status of `expr` (an absl::Status) from the enclosing function
// unless it is OK.
#define FATHOM_RETURN_IF_ERROR(expr)              \
  do {                                            \
    ::absl::Status fathom_status_macro_ = (expr); \
    if (!fathom_status_macro_.ok()) {             \
      return fathom_status_macro_;                \
    }                                             \
  } while (false)

// Evaluates `expr` (an absl::StatusOr<T>); on an error returns its status from
// the enclosing function, else moves the value into `lhs`, which may declare a
// variable. It expands to several statements, so it cannot be the only
// statement of an unbraced `if`, and `lhs` may hold no comma outside
// parentheses.
#define FATHOM_ASSIGN_OR_RETURN(lhs, ...)                             \
  FATHOM_ASSIGN_OR_RETURN_IMPL_(                                      \
      FATHOM_STATUS_MACROS_CONCAT_(fathom_status_or_, __LINE__), lhs, \
      (__VA_ARGS__))

#define FATHOM_ASSIGN_OR_RETURN_IMPL_(status_or, lhs, expr) \
  auto status_or = expr;                                    \
  if (!status_or.ok()) {                                    \
    return std::move(status_or).status();                   \
  }                                                         \
  lhs = *std::move(status_or)

#define FATHOM_STATUS_MACROS_CONCAT_(a, b) \
  FATHOM_STATUS_MACROS_CONCAT_INNER_(a, b)
#define FATHOM_STATUS_MACROS_CONCAT_INNER_(a, b) a##b

#endif  // FATHOM_BASE_STATUS_MACROS_H_
