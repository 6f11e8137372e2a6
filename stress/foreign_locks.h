// Locks of libraries, whose steps no test can schedule or count: how their policies (caches/locks.h) are told, and
// given another mutex that stands for them.
#pragma once

#include <concepts>

namespace icbench::stress {

/// A lock policy of Locked that is no template over Sync, and so names a mutex of its own.
template <class T>
concept ForeignLock = requires {
  typename T::Mutex;
  typename T::Read;
  typename T::Write;
  T::kName;
};

/// Whether readers under the policy share the lock.
template <ForeignLock T>
inline constexpr bool kReadersShare = !std::same_as<typename T::Read, typename T::Write>;

/// `Policy` with another mutex, and the scopes that go with it.
template <class Policy, class OtherMutex, class ReadScope, class WriteScope>
struct WithMutex : Policy {
  using Mutex = OtherMutex;
  using Read = ReadScope;
  using Write = WriteScope;
};

}  // namespace icbench::stress
