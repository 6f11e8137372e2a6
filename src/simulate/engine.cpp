#include "simulate/engine.h"

#include <fmt/format.h>

#include <algorithm>
#include <queue>
#include <stdexcept>
#include <unordered_map>

namespace icbench {

namespace {

Mechanism declared(const CacheTraits& traits) noexcept {
  constexpr std::pair<std::string_view, LockKind> kLocks[] = {
      {"global_mutex", LockKind::mutex},    {"global_spin", LockKind::spin},
      {"queuing_mutex", LockKind::queue},   {"shared_mutex", LockKind::futex_rw},
      {"spin_rw_mutex", LockKind::spin_rw}, {"distributed_rw", LockKind::distributed_rw},
  };
  Mechanism out;
  for (const auto& [name, kind] : kLocks) {
    if (traits.mechanism == name) out.lock = kind;
  }
  if (traits.mechanism == "node_lock")
    out.node_locks =
        traits.structure == "packed" ? Mechanism::NodeLocks::together : Mechanism::NodeLocks::in_turn;
  out.has_clock = traits.mechanism.ends_with("snapshot");
  out.has_tail = traits.mechanism == "tbb" || traits.mechanism == "append_log";
  out.sees_own_only = traits.consistency == Consistency::frame;
  out.searches_own = traits.mechanism == "append_log";
  if (out.sees_own_only)
    out.merge = traits.mechanism == "local_write" ? Mechanism::Merge::parallel : Mechanism::Merge::serial;
  return out;
}

}  // namespace

bool has_model(const CacheTraits& traits) noexcept {
  const Mechanism m = declared(traits);
  return (traits.insert != ProgressGuarantee::blocking && traits.query != ProgressGuarantee::blocking) ||
         m.lock != LockKind::none || m.node_locks != Mechanism::NodeLocks::none || m.has_tail;
}

Mechanism mechanism_of(const CacheTraits& traits) {
  if (!has_model(traits)) {
    throw std::runtime_error(
        fmt::format("cache '{}': the simulator has no model of its mechanism '{}'; add one to "
                    "src/simulate/engine.cpp",
                    traits.name, traits.mechanism));
  }
  return declared(traits);
}

namespace {

/// A node's lock: when the last one who locked it had it.
struct NodeLine {
  unsigned owner = ~0u;
  double from = 0.0, until = 0.0;
};

class Engine {
  using NodeLocks = Mechanism::NodeLocks;

 public:
  Engine(const SimulatedProgram& program, SteppedCache& cache, const SimulatedSetup& setup)
      : program_(program),
        cache_(cache),
        setup_(setup),
        machine_(setup.machine),
        mechanism_(setup.mechanism),
        beside_lock_ns_(0.5 * setup.waits.lock_ns[static_cast<std::size_t>(setup.mechanism.lock)]),
        costs_(at_pace(setup.machine, setup.costs.by_themselves(2.0 * beside_lock_ns_))),
        threads_(setup.machine.cores),
        fresh_(setup.machine.cores),
        random_(setup.seed),
        lock_(make_lock(setup.mechanism.lock, setup.machine, setup.waits, setup.seed,
                        [this](unsigned thread, double time) {
                          events_.push({time, thread, threads_[thread].waits, true});
                        })) {
    for (unsigned t = 0; t < threads_.size(); ++t) threads_[t].session = &cache.session(t);
  }

  SimulatedOutcome run() {
    cache_.reset_counters();
    const std::vector<SimulatedSegment>& segments = program_.segments();
    for (std::size_t s = 0; s < segments.size(); ++s) {
      if (segments[s].is_fresh) start_fresh(segments[s], s != 0);
      run_segment(segments[s]);
      const bool is_last = s + 1 == segments.size() || segments[s + 1].is_fresh;
      if (!is_last && segments[s].ends == nullptr) continue;
      const Stored stored = stored_now();
      if (const Trace::Frame* frame = segments[s].ends)
        out_.same_records &= stored.records == frame->stored && stored.digest.value() == frame->digest;
      if (is_last) out_.records += stored.records;
      out_.digest = stored.digest.value();
    }
    out_.operations = out_.queries + out_.inserts + out_.refused;
    const double queries = std::max(1.0, static_cast<double>(counts_.queries));
    out_.records_read_per_query = static_cast<double>(counts_.records_read) / queries;
    out_.records_valid_per_query = static_cast<double>(counts_.records_valid) / queries;
    return out_;
  }

 private:
  enum class Stage : std::uint8_t { query, neighbours, insert };

  struct Thread {
    AnySession* session = nullptr;
    Stage stage = Stage::query;
    bool is_inside = false;  // of an operation; else about to begin it
    bool is_waiting = false, is_answered = false;
    std::uint32_t waits = 0;  // so many times; events of earlier waits are stale
    std::uint32_t at = 0, end = 0, operation = 0;
    std::uint64_t own = 0;  // inserted since the last quiescent point
    double since = 0.0;     // waiting
    SimulatedOperation what;
  };
  struct Event {
    double time;
    std::uint32_t thread, waits;
    bool is_resume;
    bool operator<(const Event& o) const noexcept {  // the greatest is next
      return time != o.time ? time > o.time : thread > o.thread;
    }
  };

  /// Costs are those of one core that is alone.
  static CacheCosts at_pace(const MachineModel& machine, CacheCosts costs) {
    costs.scale(machine.pace.of(machine.cores) / machine.pace.alone);
    return costs;
  }

  void start_fresh(const SimulatedSegment& segment, bool is_again) {
    if (is_again) cache_.clear();
    fresh_.clear();
    nodes_.clear();
    cache_.begin_frame();
    for (const Record& r : segment.given) threads_[0].session->insert(r);
    cache_.end_frame();
    stored_ = merged_ = segment.given.size();
    cache_.reset_counters();
  }

  void run_segment(const SimulatedSegment& segment) {
    segment_ = &segment;
    next_chunk_ = 0;
    last_ = 0.0;
    // Virtual time goes on: lines and locks keep their state.
    const double begin = now_;
    cache_.begin_frame();
    for (unsigned t = 0; t < threads_.size(); ++t) {
      threads_[t].at = threads_[t].end = 0;
      threads_[t].own = 0;
      if (segment.is_dealt) {
        threads_[t].at = segment.chunks[t].begin;
        threads_[t].end = segment.chunks[t].end;
      }
      begin_operation(t, begin);
    }
    while (!events_.empty()) {
      const Event event = events_.top();
      events_.pop();
      Thread& thread = threads_[event.thread];
      if (event.is_resume) {
        if (thread.is_waiting && thread.waits == event.waits) resume(event.thread, event.time);
      } else if (thread.is_inside) {
        depart(event.thread, event.time);
      } else {
        arrive(event.thread, event.time);
      }
    }
    const double merge = end_frame();
    now_ = std::max(last_, begin) + merge;
    out_.merge_ns += merge;
    out_.wall_ns += now_ - begin;
    counts_ += cache_.counters();
    cache_.reset_counters();
  }

  /// The thread's next operation; its code around the operation comes first.
  void begin_operation(unsigned t, double time) {
    Thread& thread = threads_[t];
    while (thread.at == thread.end) {
      if (segment_->is_dealt || next_chunk_ == segment_->chunks.size()) {
        last_ = std::max(last_, time);
        out_.busy_ns += time - now_;
        return;
      }
      const Trace::Range chunk = segment_->chunks[next_chunk_++];
      thread.at = chunk.begin;
      thread.end = chunk.end;
    }
    thread.operation = thread.at++;
    thread.what = program_.operation(thread.operation);
    approach(t, thread.what.query != nullptr ? Stage::query : Stage::insert, time);
  }

  void approach(unsigned t, Stage stage, double time) {
    threads_[t].stage = stage;
    threads_[t].is_inside = false;
    push(t, time + (stage == Stage::insert ? costs_.outside_insert_ns : costs_.outside_query_ns) +
                beside_lock_ns_);
  }

  void arrive(unsigned t, double time) {
    if (lock_ == nullptr) return go_in(t, time);
    ++out_.lock_acquisitions;
    const Arrival arrival = lock_->enter(visitor(t), time);
    if (arrival.is_in) return go_in(t, arrival.time);
    Thread& thread = threads_[t];
    ++out_.lock_contended;
    thread.is_waiting = true;
    thread.since = arrival.time;
  }

  void resume(unsigned t, double time) {
    const auto in = lock_->resume(visitor(t), time);
    if (!in) return;
    Thread& thread = threads_[t];
    thread.is_waiting = false;
    ++thread.waits;
    const double waited = *in - thread.since;
    out_.lock_wait_ns += waited;
    if (mechanism_.lock == LockKind::mutex || mechanism_.lock == LockKind::futex_rw)
      out_.busy_ns -= std::max(0.0, waited - setup_.waits.park_ns);  // asleep
    go_in(t, *in + setup_.waits.clock_ns);
  }

  /// The operation begins; what it reads, it reads now.
  void go_in(unsigned t, double time) {
    Thread& thread = threads_[t];
    thread.is_inside = true;
    const double end = thread.stage == Stage::insert ? time_of_insert(t, time) : run_query(t, time);
    push(t, end);
  }

  /// The operation ends; what it writes is there from now on.
  void depart(unsigned t, double time) {
    Thread& thread = threads_[t];
    if (thread.stage == Stage::insert) {
      const Record record = program_.record(thread.operation);
      LockLog::words().clear();
      if (thread.session->insert(record) == InsertResult::inserted) {
        ++out_.inserts;
        ++thread.own;
        ++stored_;
        if (!mechanism_.sees_own_only) fresh_.add(record.id, t);
      } else {
        ++out_.refused;
      }
      // Those of parts are in turn held for moments of an insert; together, for all of it, which comes now.
      if (mechanism_.node_locks == NodeLocks::in_turn) time = lock_in_turn(t, time, 0.0);
      if (mechanism_.node_locks == NodeLocks::together) time = lock_together(t, time, insert_ns(thread));
    }
    if (lock_ != nullptr) time = lock_->leave(visitor(t), time) + beside_lock_ns_;
    proceed(t, time);
  }

  void proceed(unsigned t, double time) {
    Thread& thread = threads_[t];
    if (thread.stage == Stage::insert || (thread.stage == Stage::query && thread.is_answered))
      return begin_operation(t, time);
    if (thread.stage == Stage::query) {
      const double work_ns = thread.what.work_ns * machine_.pace.of(machine_.cores);
      time += work_ns;
      out_.work_ns += work_ns;
      if (thread.what.asks_neighbours) return approach(t, Stage::neighbours, time);
    }
    if (thread.what.inserts) return approach(t, Stage::insert, time);
    begin_operation(t, time);
  }

  double run_query(unsigned t, double time) {
    struct Shown {
      Engine* engine;
      unsigned core;
      std::uint64_t valid;
      double transfer_ns;
    } shown{this, t, 0, 0.0};
    Thread& thread = threads_[t];
    LockLog::words().clear();
    thread.session->visit(*thread.what.query, {[](void* context, const Record& r, float) noexcept {
                                                 auto& s = *static_cast<Shown*>(context);
                                                 ++s.valid;
                                                 if (s.engine->machine_.cores != 1)
                                                   s.transfer_ns += s.engine->first_sight(r.id, s.core);
                                               },
                                               &shown});
    if (thread.stage == Stage::query) {
      ++out_.queries;
      thread.is_answered = shown.valid != 0 && !thread.what.refuses_answer;
      out_.hits += shown.valid != 0;
    }
    double end = time + shown.transfer_ns;
    if (mechanism_.has_clock) end = clock_.read(machine_, t, end);
    out_.transfer_ns += end - time;
    const OperationCosts& of = costs_.operations;
    const double ns = (of.query.at(visible(thread)) + of.valid_ns * static_cast<double>(shown.valid)) *
                      of.query_spread.draw(random_);
    ++out_.visits;
    out_.query_ns += ns;
    if (mechanism_.node_locks == NodeLocks::in_turn) return lock_in_turn(t, end, ns);
    if (mechanism_.node_locks == NodeLocks::together) return lock_together(t, end, ns);
    return end + held(ns);
  }

  double time_of_insert(unsigned t, double time) {
    const Thread& thread = threads_[t];
    double end = time;
    if (mechanism_.has_clock) end = clock_.write(machine_, t, end);
    if (mechanism_.has_tail) end = tail_.write(machine_, t, end);
    if (lock_ != nullptr) {
      // Tickets and the allocator's place, which all share under the lock.
      constexpr double kLines = 2.0;
      end += kLines * (data_.write(machine_, t, end) - end);
    } else if (thread.own % kTicketBatch == 0) {
      end = tickets_.write(machine_, t, end);
    }
    out_.transfer_ns += end - time;
    return mechanism_.node_locks == NodeLocks::together ? end : end + held(insert_ns(thread));
  }

  double insert_ns(const Thread& thread) {
    const OperationCosts& of = costs_.operations;
    const double ns = of.insert.at(visible(thread)) * of.insert_spread.draw(random_);
    out_.insert_ns += ns;
    return ns;
  }

  /// Of an operation that takes `ns`, what is not taking the lock and giving it back.
  double held(double ns) const noexcept { return std::max(0.0, ns - 2.0 * beside_lock_ns_); }

  /// The operation's locks one after the other, each held for an equal share of `ns`; when the last is free again.
  double lock_in_turn(unsigned t, double time, double ns) {
    const auto& words = LockLog::words();
    if (words.empty()) return time + ns;
    const double hold = ns / static_cast<double>(words.size());
    out_.lock_acquisitions += words.size();
    for (const void* word : words) {
      NodeLine& node = nodes_[word];
      const double transfer = node.owner == ~0u ? 0.0 : machine_.transfer_ns(node.owner, t);
      double in = time + transfer;
      // Before the last one came, or after it left; else the lock is taken.
      const bool is_before = in + hold <= node.from;
      if (!is_before && node.until > time) {
        in = node.until + transfer;
        ++out_.lock_contended;
        out_.lock_wait_ns += in - time;
      }
      out_.transfer_ns += transfer;
      time = in + hold;
      if (!is_before) node = {t, in, time};
    }
    return time;
  }

  /// The same for locks that are all held from when the last one is taken until `ns` are over.
  double lock_together(unsigned t, double time, double ns) {
    const auto& words = LockLog::words();
    out_.lock_acquisitions += words.size();
    for (const void* word : words) {
      NodeLine& node = nodes_[word];
      const double transfer = node.owner == ~0u ? 0.0 : machine_.transfer_ns(node.owner, t);
      const double wait = std::max(0.0, node.until - time);
      out_.lock_contended += wait > 0.0;
      out_.lock_wait_ns += wait;
      out_.transfer_ns += transfer;
      time += wait + transfer;
    }
    for (const void* word : words) nodes_[word] = {t, time, time + ns};
    return time + ns;
  }

  /// What the core waits for a record that it sees for the first time: as measured within a complex, and from farther
  /// away in proportion to transfers.
  double first_sight(std::uint32_t id, unsigned core) {
    const unsigned from = fresh_.see(id, core);
    if (from == FreshRecords::kNobody) return 0.0;
    const double near = machine_.transfers.ns[0];
    const double ns = costs_.operations.fresh_ns;
    return near > 0.0 ? ns * machine_.transfer_ns(from, core) / near : ns;
  }

  /// Records on which the cost of a query or an insert of the thread depends.
  std::uint64_t visible(const Thread& thread) const noexcept {
    if (mechanism_.searches_own) return thread.own;
    return mechanism_.sees_own_only ? merged_ + thread.own : stored_;
  }

  /// Ends the frame; returns what merging takes.
  double end_frame() {
    cache_.end_frame();
    fresh_.clear();
    double merge = 0.0;
    for (unsigned t = 0; t < threads_.size(); ++t) {
      const double mine = static_cast<double>(threads_[t].own) * costs_.merge_record_ns;
      if (mechanism_.merge == Mechanism::Merge::serial) merge += mine;
      // One helper after the other is started (core/parallel.h).
      if (mechanism_.merge == Mechanism::Merge::parallel)
        merge = std::max(merge, mine + setup_.waits.start_ns * t);
      if (mechanism_.merge != Mechanism::Merge::none) out_.busy_ns += mine;
    }
    merged_ = stored_;
    return merge;
  }

  struct Stored {
    RecordsDigest digest;
    std::uint64_t records = 0;
  };
  Stored stored_now() {
    Stored stored;
    cache_.for_each_record({[](void* context, const Record& r, float) noexcept {
                              auto& s = *static_cast<Stored*>(context);
                              s.digest.add(r);
                              ++s.records;
                            },
                            &stored});
    return stored;
  }

  Visitor visitor(unsigned t) const noexcept { return {t, t, threads_[t].stage == Stage::insert}; }
  void push(unsigned t, double time) { events_.push({time, t, 0, false}); }

  const SimulatedProgram& program_;
  SteppedCache& cache_;
  const SimulatedSetup& setup_;
  const MachineModel& machine_;
  const Mechanism mechanism_;
  const double beside_lock_ns_;  // before it is held, and after
  const CacheCosts costs_;
  std::vector<Thread> threads_;  // thread t on core t
  FreshRecords fresh_;
  Pcg32 random_;
  std::unique_ptr<VirtualLock> lock_;
  std::priority_queue<Event> events_;
  std::unordered_map<const void*, NodeLine> nodes_;
  Line clock_, tail_, tickets_, data_;
  const SimulatedSegment* segment_ = nullptr;
  std::size_t next_chunk_ = 0;
  std::uint64_t stored_ = 0, merged_ = 0;
  double now_ = 0.0, last_ = 0.0;
  Counts counts_;
  SimulatedOutcome out_;
};

}  // namespace

SimulatedOutcome simulate(const SimulatedProgram& program, SteppedCache& cache, const SimulatedSetup& setup) {
  return Engine(program, cache, setup).run();
}

}  // namespace icbench
