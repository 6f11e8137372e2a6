// icbench compare, called as from the command line, and the suggestions of all subcommands.
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/names.h"
#include "image/file.h"
#include "image/image.h"
#include "temporary_folder.h"

namespace icbench {

void add_compare(CLI::App& app);

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
    CLI::App app;
    add_compare(app);
    arguments.insert(arguments.begin(), "compare");
    std::reverse(arguments.begin(), arguments.end());
    app.parse(arguments);
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
  EXPECT_EQ(nearest("zzzzzz", names), "");
  EXPECT_EQ(nearest("", names), "");
  EXPECT_EQ(nearest("null", {}), "");
  EXPECT_EQ(unknown_name("cache", "nul", names),
            "unknown cache 'nul'; did you mean 'null'? known: wait_free, local_write, null");
}

}  // namespace
}  // namespace icbench
