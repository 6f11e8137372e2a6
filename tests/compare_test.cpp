// icbench compare, called as from the command line, and the suggestions of all subcommands.
#include "cli/compare.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/names.h"
#include "files/input_file.h"
#include "image/image.h"
#include "temporary_folder.h"

namespace icbench {
namespace {

class Compare : public ::testing::Test {
 protected:
  Compare() {
    for (const auto& [name, value] : {std::pair{"a.exr", 0.5f}, {"b.exr", 0.75f}}) {
      Image image = make_image(8, 4);
      for (glm::vec3& pixel : image.pixels) pixel = glm::vec3(value);
      write_image(folder / name, image);
    }
  }

  /// Runs the subcommand; "%" in an argument stands for the test's folder.
  void run(std::vector<std::string> arguments) {
    for (std::string& argument : arguments) {
      if (argument.starts_with('%')) argument = folder / argument.substr(1).c_str();
    }
    run_compare(std::move(arguments));
  }

  TemporaryFolder folder;
};

TEST_F(Compare, WritesFiguresAndMaps) {
  run({"%a.exr", "%b.exr", "--metrics", "rmse,mean_ratio,relmse,block_rmse", "--json", "%out.json", "--map",
       "%maps"});
  const auto json = nlohmann::json::parse(load_file(folder / "out.json"));
  EXPECT_DOUBLE_EQ(json.at("rmse"), 0.25);
  EXPECT_DOUBLE_EQ(json.at("mean_ratio"), 1.5);
  EXPECT_DOUBLE_EQ(json.at("relmse"), 0.0625 / 0.26);
  EXPECT_DOUBLE_EQ(json.at("block_rmse"), 0.5);
  EXPECT_EQ(json.at("width"), 8);
  EXPECT_EQ(read_image(folder / "maps/rmse.exr").pixels.at(31), glm::vec3(0.25f));
  EXPECT_TRUE(std::filesystem::exists(folder / "maps/relmse.exr"));
  EXPECT_TRUE(std::filesystem::exists(folder / "maps/block_rmse.exr"));
  EXPECT_FALSE(std::filesystem::exists(folder / "maps/mean_ratio.exr"));
}

TEST_F(Compare, DefaultsAndOptionsBeforeTheImages) {
  run({"--json", "%out.json", "%a.exr", "%b.exr"});
  EXPECT_TRUE(nlohmann::json::parse(load_file(folder / "out.json")).contains("relmse"));
  run({"--metrics", "rmse", "--json", "%out.json", "%b.exr", "%a.exr"});
  EXPECT_FALSE(nlohmann::json::parse(load_file(folder / "out.json")).contains("relmse"));
}

TEST_F(Compare, StatesHowTheImagesAreLookedAt) {
  run({"%a.exr", "%b.exr", "--metrics", "flip,hdrvdp", "--json", "%out.json", "--map", "%maps"});
  auto json = nlohmann::json::parse(load_file(folder / "out.json"));
  EXPECT_GT(json.at("flip"), 0.0);
  EXPECT_EQ(json.at("hdrvdp").at("p75"), 0.0);  // a factor of the whole is not seen
  EXPECT_EQ(json.at("hdrvdp").at("p95"), 0.0);
  EXPECT_EQ(json.at("viewing").at("luminance_scale"), 179.0);
  EXPECT_EQ(json.at("viewing").at("distance"), 0.5);
  EXPECT_EQ(json.at("viewing").at("display_pixels"), nlohmann::json({1280, 1024}));
  EXPECT_EQ(json.at("viewing").at("display_size"), nlohmann::json({0.375, 0.3}));
  EXPECT_EQ(json.at("viewing").at("flip_pixels_per_degree"), 67.0);
  for (const char* name : {"maps/flip.exr", "maps/flip.png", "maps/hdrvdp.exr", "maps/hdrvdp.png"}) {
    EXPECT_EQ(read_image(folder / name).width, 8) << name;
  }
  EXPECT_NEAR(read_image(folder / "maps/flip.exr").pixels.at(0).x, json.at("flip").get<double>(), 1e-6);

  run({"%a.exr", "%b.exr", "--json", "%out.json", "--luminance-scale", "1e2", "--distance", "0.7",
       "--display-pixels", "3840x2160", "--display-size", "0.7x0.39375", "--pixels-per-degree", "60"});
  json = nlohmann::json::parse(load_file(folder / "out.json"));
  EXPECT_EQ(json.at("viewing").at("luminance_scale"), 100.0);
  EXPECT_EQ(json.at("viewing").at("display_pixels"), nlohmann::json({3840, 2160}));
  EXPECT_NEAR(json.at("viewing").at("pixels_per_degree").get<double>(), 67.0, 0.1);
  EXPECT_EQ(json.at("viewing").at("flip_pixels_per_degree"), 60.0);
}

TEST_F(Compare, ViewingOutOfRangeIsOneLine) {
  const auto refuses = [&](const char* option, const char* value, const char* part) {
    return is_one_line_with(error_of([&] { run({"%a.exr", "%b.exr", option, value}); }), part);
  };
  EXPECT_TRUE(refuses("--luminance-scale", "0", "luminance scale of 0"));
  EXPECT_TRUE(refuses("--luminance-scale", "nan", "luminance scale"));
  EXPECT_TRUE(refuses("--distance", "1 m", "--distance '1 m' is not a number"));
  EXPECT_TRUE(refuses("--display-pixels", "1280", "WxH"));
  EXPECT_TRUE(refuses("--display-pixels", "0x100", "'0'"));
  EXPECT_TRUE(refuses("--display-size", "0.3x", "not a number"));
  EXPECT_TRUE(refuses("--pixels-per-degree", "-1", "pixels per degree"));
}

TEST_F(Compare, FoldersFrameByFrame) {
  // Differences of 0, 0.25 and -0.5 on references that move; names count without leading zeros.
  const std::pair<const char*, std::array<float, 2>> frames[] = {
      {"frame_2", {1.0f, 1.0f}}, {"frame_9", {1.0f, 1.25f}}, {"frame_10", {2.0f, 1.5f}}};
  std::filesystem::create_directories(folder / "A");
  std::filesystem::create_directories(folder / "B");
  for (const auto& [name, levels] : frames) {
    for (const std::size_t which : {0u, 1u}) {
      Image image = make_image(8, 4);
      for (glm::vec3& pixel : image.pixels) pixel = glm::vec3(levels[which]);
      const std::filesystem::path path = folder / (which == 0 ? "A" : "B") / name;
      write_image(path.string() + ".exr", image);
      if (which == 0) write_image(path.string() + ".png", image);  // .exr comes first
    }
  }
  run({"%A", "%B", "--metrics", "rmse,hdrvdp", "--json", "%out.json", "--map", "%maps"});
  const auto json = nlohmann::json::parse(load_file(folder / "out.json"));
  EXPECT_DOUBLE_EQ(json.at("rmse"), 0.25);
  EXPECT_DOUBLE_EQ(json.at("flicker"), 0.75) << "frame 9 does not follow frame 2";
  EXPECT_EQ(json.at("hdrvdp").at("p75"), 0.0);
  EXPECT_TRUE(json.contains("viewing"));
  ASSERT_EQ(json.at("frames").size(), 3u);
  EXPECT_EQ(json.at("frames").at(1).at("image"), "frame_9.exr");
  EXPECT_EQ(json.at("frames").at(2).at("image"), "frame_10.exr");
  EXPECT_DOUBLE_EQ(json.at("frames").at(2).at("rmse"), 0.5);
  EXPECT_EQ(read_image(folder / "maps/rmse/frame_9.exr").pixels.at(3), glm::vec3(0.25f));
  EXPECT_TRUE(std::filesystem::exists(folder / "maps/hdrvdp/frame_10.png"));

  EXPECT_TRUE(is_one_line_with(error_of([&] { run({"%A", "%a.exr"}); }), "two images or two folders"));
  std::filesystem::create_directories(folder / "none");
  EXPECT_TRUE(is_one_line_with(error_of([&] { run({"%A", "%none"}); }), "none' holds no frame_*.exr"));
  write_image(folder / "B/frame_10.exr", make_image(4, 8));
  EXPECT_TRUE(is_one_line_with(error_of([&] { run({"%A", "%B"}); }), "B/frame_10.exr: cannot compare"));
  std::filesystem::remove(folder / "B/frame_10.exr");
  EXPECT_TRUE(is_one_line_with(error_of([&] { run({"%A", "%B"}); }), "3 and 2 frames"));
}

TEST_F(Compare, FoldersMustHoldFramesOfTheSameNumbers) {
  for (const char* name : {"A/frame_0000.exr", "A/frame_0050.exr", "B/frame_0.exr", "B/frame_1.exr"}) {
    std::filesystem::create_directories((folder / name).parent_path());
    write_image(folder / name, make_image(8, 4));
  }
  EXPECT_TRUE(is_one_line_with(error_of([&] { run({"%A", "%B"}); }), "A/frame_0050.exr' and "));
  std::filesystem::rename(folder / "B/frame_1.exr", folder / "B/frame_50.exr");
  EXPECT_NO_THROW(run({"%A", "%B"}));
}

TEST_F(Compare, ABlackFrameHasNoRatioAndTheOthersHaveTheirs) {
  for (const auto& [name, level] : {std::pair{"A/frame_0.exr", 0.0f},
                                    {"A/frame_1.exr", 2.0f},
                                    {"B/frame_0.exr", 1.0f},
                                    {"B/frame_1.exr", 3.0f}}) {
    Image image = make_image(8, 4);
    for (glm::vec3& pixel : image.pixels) pixel = glm::vec3(level);
    std::filesystem::create_directories((folder / name).parent_path());
    write_image(folder / name, image);
  }
  run({"%A", "%B", "--metrics", "mean_ratio,rmse", "--json", "%out.json"});
  const auto json = nlohmann::json::parse(load_file(folder / "out.json"));
  EXPECT_EQ(json.at("mean_ratio"), 1.5);
  EXPECT_EQ(json.at("rmse"), 1.0);
  EXPECT_TRUE(json.at("frames").at(0).at("mean_ratio").is_null());
  EXPECT_EQ(json.at("frames").at(1).at("mean_ratio"), 1.5);
}

TEST_F(Compare, ChecksTheMapFolderBeforeTheWork) {
  // The metric refuses these images, so whoever complains about the folder looked at it first.
  write_image(folder / "smaller.exr", make_image(7, 4));
  const auto error = [&](const char* map) {
    return error_of([&] { run({"%smaller.exr", "%b.exr", "--metrics", "block_rmse", "--map", map}); });
  };
  EXPECT_TRUE(is_one_line_with(error("%maps"), "cannot compare images of 7 x 4"));
  EXPECT_TRUE(is_one_line_with(error("%a.exr"), "--map"));
  EXPECT_TRUE(is_one_line_with(error("%a.exr/maps"), "--map"));
  EXPECT_TRUE(is_one_line_with(error("/proc/icbench"), "--map"));
}

TEST_F(Compare, ErrorsAreOneLine) {
  EXPECT_TRUE(is_one_line_with(error_of([&] {
                                 run({"%a.exr", "%b.exr", "--metrics", "relmes"});
                               }),
                               "did you mean 'relmse'?"));
  EXPECT_TRUE(is_one_line_with(error_of([&] { run({"%a.exr", "%none.exr"}); }), "none.exr"));
  EXPECT_TRUE(is_one_line_with(error_of([&] {
                                 run({"%a.exr", "%b.exr", "--json", "/dev/full"});
                               }),
                               "/dev/full"));
  EXPECT_TRUE(is_one_line_with(error_of([&] { run({"%a.exr", "%b.exr", "--map", "%a.exr"}); }), "a.exr"));
  write_image(folder / "other.exr", make_image(4, 8));
  EXPECT_TRUE(is_one_line_with(error_of([&] { run({"%a.exr", "%other.exr"}); }), "8 x 4 and 4 x 8"));
}

TEST(Suggest, EditDistance) {
  EXPECT_EQ(edit_distance("", ""), 0u);
  EXPECT_EQ(edit_distance("", "abc"), 3u);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3u);
  EXPECT_EQ(edit_distance("sitting", "kitten"), 3u);
  EXPECT_EQ(edit_distance("flaw", "lawn"), 2u);
}

TEST(Suggest, NearestIsCloseOrNothing) {
  constexpr std::string_view names[] = {"wait_free", "local_write", "null"};
  EXPECT_EQ(nearest("waitfree", names), "wait_free");
  EXPECT_EQ(nearest("nul", names), "null");
  EXPECT_EQ(nearest("w", names), "wait_free");
  EXPECT_EQ(nearest("zzzzzz", names), "");
  EXPECT_EQ(nearest("", names), "");
  EXPECT_EQ(nearest("null", {}), "");
  EXPECT_EQ(unknown_name("cache", "nul", names),
            "unknown cache 'nul'; did you mean 'null'? known: wait_free, local_write, null");
}

}  // namespace
}  // namespace icbench
