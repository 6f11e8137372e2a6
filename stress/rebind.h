// Puts other policies into a cache: Rebound<Cache, Replace> is Cache with Replace<T>::type in the place of every type
// argument T, however deep, of templates whose parameters are all types. It is how the shipping code runs under delays,
// under a model of memory, or under a count of its steps.
#pragma once

namespace icbench::stress {

template <class T, template <class> class Replace>
struct Rebind {
  using type = typename Replace<T>::type;
};
template <template <class...> class Template, class... Args, template <class> class Replace>
struct Rebind<Template<Args...>, Replace> {
  using type = Template<typename Rebind<Args, Replace>::type...>;
};

template <class T, template <class> class Replace>
using Rebound = typename Rebind<T, Replace>::type;

}  // namespace icbench::stress
