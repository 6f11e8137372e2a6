#include "render/record_source.h"

namespace icbench {

void CacheUse::count(InsertResult result) noexcept {
  switch (result) {
    case InsertResult::inserted:
      ++inserts;
      break;
    case InsertResult::full:
      ++full;
      break;
    case InsertResult::rejected:
      ++rejected;
      break;
  }
}

CacheUse& CacheUse::operator+=(const CacheUse& o) noexcept {
  queries += o.queries;
  hits += o.hits;
  inserts += o.inserts;
  full += o.full;
  rejected += o.rejected;
  leaks += o.leaks;
  return *this;
}

void RecordSource::found_no_room() noexcept {}

void RecordSource::settle(unsigned, const Record&, InsertResult) noexcept {}

UpdateResult RecordSource::update(Record&) noexcept { return UpdateResult::keep; }

void RecordSource::updated() noexcept {}

void RecordSource::refused(const Record&) {}

void RecordSource::used(const Record&) noexcept {}

void RecordSource::report(PassFigures&) const noexcept {}

}  // namespace icbench
