// The file in which a calibration is kept.
#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <stdexcept>

#include "files/input_file.h"
#include "files/json_file.h"
#include "simulate/calibration.h"

namespace icbench {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "icbench calibration of simulations";
constexpr int kVersion = 5;

double number_at(const Json& j, const char* name) {
  if (!j.is_object() || !j.contains(name) || !j[name].is_number() || !(j[name].get<double>() >= 0.0))
    throw std::runtime_error(fmt::format("'{}' is no number >= 0", name));
  return j[name].get<double>();
}

template <std::size_t N>
void read_numbers(const Json& j, const char* name, std::array<double, N>& out) {
  const Json all = j.value(name, Json());
  if (!all.is_array() || all.size() != N)
    throw std::runtime_error(fmt::format("'{}' has not {} numbers", name, N));
  for (std::size_t i = 0; i < N; ++i) {
    if (!all[i].is_number() || !(all[i].get<double>() >= 0.0))
      throw std::runtime_error(fmt::format("'{}' has not {} numbers >= 0", name, N));
    out[i] = all[i].get<double>();
  }
}

std::string text_at(const Json& j, const char* name) {
  if (!j.is_object() || !j.contains(name) || !j[name].is_string())
    throw std::runtime_error(fmt::format("'{}' is no text", name));
  return j[name].get<std::string>();
}

struct WaitField {
  const char* name;
  double WaitCosts::*member;
};
constexpr WaitField kWaits[] = {{"park_ns", &WaitCosts::park_ns},   {"check_ns", &WaitCosts::check_ns},
                                {"pause_ns", &WaitCosts::pause_ns}, {"yield_ns", &WaitCosts::yield_ns},
                                {"clock_ns", &WaitCosts::clock_ns}, {"start_ns", &WaitCosts::start_ns}};

Calibration parse(const Json& j) {
  if (!j.is_object() || !j.contains("format") || j.at("format") != kFormat)
    throw std::runtime_error("this is no calibration; name another file by --calibration");
  if (!j.contains("version") || j.at("version") != kVersion)
    throw std::runtime_error("it is of another version; give --recalibrate");
  Calibration c;
  c.host_name = text_at(j, "host_name");
  c.cpu_model = text_at(j, "cpu_model");
  c.commit = text_at(j, "commit");
  c.date = text_at(j, "date");
  read_numbers(j, "transfer_ns", c.transfers.ns);
  c.is_transfer_measured = j.value("transfer_measured", false);
  for (const WaitField& field : kWaits)
    c.waits.*field.member = number_at(j.value("waits", Json()), field.name);
  read_numbers(j["waits"], "wake_call_ns", c.waits.wake_call_ns.ns);
  read_numbers(j["waits"], "wake_delay_ns", c.waits.wake_delay_ns.ns);
  read_numbers(j["waits"], "lock_ns", c.waits.lock_ns);
  read_numbers(j["waits"], "queue_ns", c.waits.queue.ns);
  c.waits.queue.leave_ns = number_at(j["waits"], "queue_leave_ns");
  c.waits.queue.transfer_ns = number_at(j["waits"], "queue_transfer_ns");
  std::array<double, 2> pace;
  read_numbers(j, "pace", pace);
  c.pace = {pace[0], pace[1]};
  if (c.pace.alone <= 0.0 || c.pace.together <= 0.0) throw std::runtime_error("a 'pace' is not above 0");
  c.harness_query_ns = number_at(j, "harness_query_ns");
  const Json all = j.value("costs", Json::object());
  if (!all.is_object()) throw std::runtime_error("'costs' is no object");
  for (const auto& [key, costs] : all.items()) {
    try {
      c.costs[key] = CacheCosts::from_json(costs);
    } catch (const std::runtime_error& e) {
      throw std::runtime_error(fmt::format("costs of '{}': {}", key, e.what()));
    }
  }
  if (j.contains("validation")) {
    const Json& v = j["validation"];
    Validation out;
    const auto count_at = [&](const char* name) {
      constexpr double kMost = 1e6;
      const double n = number_at(v, name);
      if (n > kMost) throw std::runtime_error(fmt::format("validation: '{}' is more than {}", name, kMost));
      return static_cast<unsigned>(n);
    };
    out.threads = count_at("threads");
    if (v.contains("cores_per_complex")) out.cores_per_complex = count_at("cores_per_complex");
    if (v.contains("cores_per_socket")) out.cores_per_socket = count_at("cores_per_socket");
    out.points = count_at("points");
    out.records_points = count_at("records_points");
    out.waiting_points = count_at("waiting_points");
    out.throughput_error = number_at(v, "throughput_error");
    out.file_error = number_at(v, "file_error");
    out.records_error = number_at(v, "records_error");
    out.waiting_error = number_at(v, "waiting_error");
    out.date = text_at(v, "date");
    out.commit = text_at(v, "commit");
    if (!v.contains("errors") || !v["errors"].is_object())
      throw std::runtime_error("validation: there is no object 'errors'");
    for (const auto& [key, unused] : v["errors"].items())
      out.errors[key] = number_at(v["errors"], key.c_str());
    c.validation = out;
  }
  return c;
}

}  // namespace

bool Validation::holds() const noexcept {
  return points != 0 && throughput_error <= kBar && records_error <= kBar && waiting_error <= kBar &&
         file_error <= kBar;
}

nlohmann::ordered_json Calibration::to_json() const {
  Json j = {{"format", kFormat},
            {"version", kVersion},
            {"host_name", host_name},
            {"cpu_model", cpu_model},
            {"commit", commit},
            {"date", date},
            {"transfer_ns", transfers.ns},
            {"transfer_measured", is_transfer_measured}};
  for (const WaitField& field : kWaits) j["waits"][field.name] = waits.*field.member;
  j["waits"]["wake_call_ns"] = waits.wake_call_ns.ns;
  j["waits"]["wake_delay_ns"] = waits.wake_delay_ns.ns;
  j["waits"]["lock_ns"] = waits.lock_ns;
  j["waits"]["queue_ns"] = waits.queue.ns;
  j["waits"]["queue_leave_ns"] = waits.queue.leave_ns;
  j["waits"]["queue_transfer_ns"] = waits.queue.transfer_ns;
  j["pace"] = {pace.alone, pace.together};
  j["harness_query_ns"] = harness_query_ns;
  if (validation) {
    j["validation"] = {{"threads", validation->threads},
                       {"cores_per_complex", validation->cores_per_complex},
                       {"cores_per_socket", validation->cores_per_socket},
                       {"points", validation->points},
                       {"records_points", validation->records_points},
                       {"waiting_points", validation->waiting_points},
                       {"throughput_error", validation->throughput_error},
                       {"records_error", validation->records_error},
                       {"waiting_error", validation->waiting_error},
                       {"file_error", validation->file_error},
                       {"date", validation->date},
                       {"commit", validation->commit},
                       {"errors", validation->errors}};
  }
  j["costs"] = Json::object();
  for (const auto& [key, c] : costs) j["costs"][key] = c.to_json();
  return j;
}

std::string default_calibration_path() {
  const char* const cache = std::getenv("XDG_CACHE_HOME");
  const char* const home = std::getenv("HOME");
  // A path that is not absolute is to be ignored (XDG base directory specification).
  const std::filesystem::path folder = cache != nullptr && cache[0] == '/' ? std::filesystem::path(cache)
                                       : home != nullptr ? std::filesystem::path(home) / ".cache"
                                                         : std::filesystem::temp_directory_path();
  return (folder / "icbench" / "calibration.json").string();
}

std::optional<Calibration> read_calibration(const std::string& path) {
  std::error_code none;
  if (!std::filesystem::exists(path, none)) return std::nullopt;
  if (!std::filesystem::is_regular_file(path, none)) {
    throw std::runtime_error(fmt::format("calibration '{}' is {}; name a file by --calibration", path,
                                         std::filesystem::is_directory(path, none) ? "a folder" : "no file"));
  }
  const std::string text = load_file(path);
  try {
    const Json j = Json::parse(text, nullptr, false);
    if (j.is_discarded()) throw std::runtime_error("this is no JSON");
    return parse(j);
  } catch (const std::exception& e) {
    throw std::runtime_error(fmt::format("calibration '{}': {}", path, e.what()));
  }
}

void make_folder_of(const std::string& path) {
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (!folder.empty()) std::filesystem::create_directories(folder, error);
  if (error) {
    throw std::runtime_error(fmt::format(
        "calibration '{}': its folder cannot be made ({}); give --calibration", path, error.message()));
  }
}

void write_calibration(const Calibration& calibration, const std::string& path) {
  make_folder_of(path);
  write_json(path, calibration.to_json(), 1);
}

namespace {

/// What is in the file, if it goes back to the same measurement of the machine.
std::optional<Calibration> of_the_same(const Calibration& calibration, const std::string& path) {
  try {
    std::optional<Calibration> there = read_calibration(path);
    const bool is_same = there && there->host_name == calibration.host_name &&
                         there->cpu_model == calibration.cpu_model && there->date == calibration.date;
    return is_same ? there : std::nullopt;
  } catch (const std::runtime_error&) {
    return std::nullopt;  // damaged meanwhile: replaced
  }
}

}  // namespace

void add_costs(const Calibration& calibration, const std::string& key, const std::string& path) {
  Calibration all = of_the_same(calibration, path).value_or(calibration);
  all.costs[key] = calibration.costs.at(key);
  write_calibration(all, path);
}

void write_validated(Calibration calibration, const std::string& path) {
  if (const auto there = of_the_same(calibration, path))
    calibration.costs.insert(there->costs.begin(), there->costs.end());
  write_calibration(calibration, path);
}

}  // namespace icbench
