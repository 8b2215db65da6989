// SPDX-License-Identifier: MIT
// Option tables, the registry, budgets, and what build_store checks around a method's own build. The methods
// here are toys: this file defines the registry's list itself.
#include "base/options.h"

#include <doctest/doctest.h>

#include <limits>

#include "geometry/mesh.h"
#include "method/registry.h"
#include "store_fixture.h"

using namespace lodlab;
using namespace lodlab::testing;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

const std::vector<OptionSpec> kTable = {
    {"exact", true, Stage::kBuild, "", "A flag.", {}},
    {"leaf", int64_t{64}, Stage::kBuild, "samples", "A whole number.", {}, 2, 1024},
    {"finest_error", 0.0, Stage::kBuild, "m", "A number.", {}, 0},
    {"morph", std::string("true"), Stage::kDraw, "", "One of a few.", {"true", "formula4", "false"}},
    {"attribute", std::string(), Stage::kBuild, "", "A file.", {}},
};

Options resolve(const std::map<std::string, OptionValue>& given, Stage stage = Stage::kBuild) {
  return resolve_options("toy", kTable, stage, given);
}

template <class Error, class Work>
std::string message_of(const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

/// Puts ten pages whose bytes depend on nothing; can be told to stop half-way.
class Toy : public Method {
 public:
  explicit Toy(std::string name, std::vector<std::string> accepts = {"heightfield"},
               Needs needs = Needs::kAnything) {
    info_.name = std::move(name);
    info_.accepts = std::move(accepts);
    info_.needs = needs;
    info_.budgets = {"pixel_error", "triangles"};
    info_.options = kTable;
  }
  const MethodInfo& info() const override { return info_; }
  void build(const Source&, const Options&, StoreWriter& writer, const Progress& progress) const override {
    for (int64_t id = 1; id <= 10; ++id) {
      progress("pages", 0.1 * static_cast<double>(id - 1));
      if (!writer.has_page(0, id)) {
        writer.put_page(0, id, page_bytes(id));
        ++put;
      }
    }
    progress("pages", 1.0);
  }
  std::shared_ptr<const Hierarchy> open(std::shared_ptr<const Store>) const override { return nullptr; }
  mutable int put = 0;

 private:
  MethodInfo info_;
};

const Toy& toy() {
  static const Toy method("toy");
  return method;
}

HeightField small_field(bool planet = false) {
  static const std::vector<float> heights{1, 2, 3, 4, 5, 6};
  HeightField field;
  field.rows = 2;
  field.cols = 3;
  field.planet = planet;
  field.heights = heights.data();
  field.spec = "six samples";
  return field;
}

}  // namespace

namespace lodlab {
std::vector<const Method*> built_in_methods() { return {&toy()}; }
}  // namespace lodlab

TEST_CASE("options not given have their defaults, of their stage only") {
  const Options options = resolve({});
  CHECK(options.flag("exact"));
  CHECK(options.integer("leaf") == 64);
  CHECK(options.real("finest_error") == 0.0);
  CHECK(options.text("attribute").empty());
  CHECK(options.values().size() == 4);
  CHECK(resolve({}, Stage::kDraw).text("morph") == "true");
}

TEST_CASE("options as a command line or a program gives them") {
  CHECK(resolve({{"leaf", std::string("32")}}).integer("leaf") == 32);
  CHECK(resolve({{"leaf", 32.0}}).integer("leaf") == 32);
  CHECK(resolve({{"finest_error", int64_t{2}}}).real("finest_error") == 2.0);
  CHECK(resolve({{"finest_error", std::string("0.25")}}).real("finest_error") == 0.25);
  CHECK(!resolve({{"exact", std::string("false")}}).flag("exact"));
  CHECK(resolve({{"morph", false}}, Stage::kDraw).text("morph") == "false");
  CHECK(resolve({{"morph", std::string("formula4")}}, Stage::kDraw).text("morph") == "formula4");
}

TEST_CASE("bad options are refused with value and limit") {
  const auto refused = [](const std::string& name, OptionValue value, Stage stage = Stage::kBuild) {
    return message_of<InvalidInput>([&] { resolve({{name, value}}, stage); });
  };
  CHECK(refused("laef", int64_t{1}) ==
        "toy: unknown build option 'laef'; known: attribute, exact, finest_error, leaf");
  CHECK(says(refused("morph", std::string("true")), "unknown build option 'morph'"));
  CHECK(refused("leaf", int64_t{1}) == "toy: option leaf = 1 is not a whole number from 2 to 1024");
  CHECK(says(refused("leaf", 2.5), "leaf = 2.5 is not a whole number"));
  CHECK(says(refused("leaf", std::string("many")), "leaf = many"));
  CHECK(says(refused("leaf", true), "leaf = true"));
  CHECK(says(refused("leaf", kNaN), "leaf = nan"));
  CHECK(says(refused("leaf", kInfinity), "leaf = inf"));
  CHECK(refused("finest_error", -1.0) ==
        "toy: option finest_error = -1 is not a finite number of at least 0");
  CHECK(says(refused("finest_error", kNaN), "finite number"));
  CHECK(says(refused("finest_error", kInfinity), "finite number"));
  CHECK(says(refused("exact", int64_t{1}), "exact = 1 is not true or false"));
  CHECK(refused("morph", std::string("slow"), Stage::kDraw) ==
        "toy: option morph = slow is not one of true, formula4, false");
}

TEST_CASE("options as JSON are sorted and exact") {
  CHECK(resolve({{"finest_error", 0.1}, {"attribute", std::string("a \"b\"\\\n.png")}}).to_json() ==
        R"({"attribute":"a \"b\"\\\n.png","exact":true,"finest_error":0.1,"leaf":64})");
}

TEST_CASE("methods are found by name") {
  CHECK(&find_method("toy") == &toy());
  CHECK(message_of<InvalidInput>([] { find_method("yot"); }) == "method: unknown method 'yot'; known: toy");
  static const Toy second("second");
  register_method(&second);
  CHECK(&find_method("second") == &second);
  CHECK(methods().size() == 2);
  CHECK(says(message_of<InvalidInput>([] { register_method(&second); }), "'second' already"));
}

TEST_CASE("budgets") {
  const MethodInfo& info = toy().info();
  CHECK_NOTHROW(check_budget(info, {1.0, {}, {}}));
  CHECK_NOTHROW(check_budget(info, {kInfinity, 1, {}}));
  const auto bad = [&](const Budget& budget) {
    return message_of<InvalidInput>([&] { check_budget(info, budget); });
  };
  CHECK(bad({0.0, {}, {}}) == "budget: pixel_error = 0 is not positive");
  CHECK(bad({kNaN, {}, {}}) == "budget: pixel_error = nan is not positive");
  CHECK(bad({-1.5, {}, {}}) == "budget: pixel_error = -1.5 is not positive");
  CHECK(bad({1.0, -7, {}}) == "budget: triangles = -7 is not positive");
  CHECK(bad({1.0, 7, 0}) == "budget: nodes = 0 is not positive");
  CHECK(says(bad({}), "none is set; method toy needs at least one of pixel_error, triangles"));
  CHECK(says(message_of<Unsupported>([&] { check_budget(info, {{}, {}, 5}); }), "method toy knows no nodes"));
  MethodInfo full;
  full.name = "full";
  CHECK_NOTHROW(check_budget(full, {}));
  CHECK_NOTHROW(check_budget(full, {1.0, 5, 5}));
  CHECK_THROWS_AS(check_budget(full, {kNaN, {}, {}}), InvalidInput);
}

TEST_CASE("a store says what it was built from") {
  const TemporaryFolder folder;
  const auto store =
      build_store(small_field(), toy(), {{"leaf", int64_t{8}}}, folder / "a.lod", BuildMode::kNew, {});
  CHECK(store->meta().method == "toy");
  CHECK(store->meta().options == R"({"attribute":"","exact":true,"finest_error":0,"leaf":8})");
  CHECK(store->meta().source_hash == small_field().hash());
  CHECK(store->meta().source_spec == "six samples");
  CHECK(frame_from_json(store->meta().frame).cols == 3);
}

TEST_CASE("a build that cannot be is refused before anything is written") {
  const TemporaryFolder folder;
  const std::string path = folder / "a.lod";
  const auto build = [&](const Source& source, const Method& method,
                         std::map<std::string, OptionValue> options) {
    build_store(source, method, options, path, BuildMode::kNew, {});
  };
  const std::string planet = message_of<Unsupported>([&] { build(small_field(true), toy(), {}); });
  CHECK(planet == "build: method toy does not accept a planet; it accepts heightfield");
  CHECK_THROWS_AS(build(small_field(), Toy("mesher", {"mesh"}), {}), Unsupported);
  CHECK_THROWS_AS(build(small_field(), toy(), {{"leaf", int64_t{0}}}), InvalidInput);
  CHECK(folder.files() == 0);
}

/// Over ten vertices, no three on a line, of which the last lies where the first does.
std::shared_ptr<const Mesh> over_ten(const std::vector<Face>& faces) {
  static const auto positions = [] {
    std::vector<glm::dvec3> out;
    for (const double t : {0, 1, 2, 3, 4, 5, 6, 7, 8, 0}) out.emplace_back(t, t * t, t * t * t);
    return out;
  }();
  const auto owner = std::make_shared<const std::vector<Face>>(faces);
  return make_mesh({positions, *owner, {}, {}, owner}, "test");
}

std::vector<Face> torus() {
  std::vector<Face> out;
  const auto at = [](uint32_t row, uint32_t col) { return row % 3 * 3 + col % 3; };
  for (uint32_t i = 0; i < 9; ++i) {
    const uint32_t r = i / 3, c = i % 3;
    out.push_back({at(r, c), at(r + 1, c), at(r + 1, c + 1)});
    out.push_back({at(r, c), at(r + 1, c + 1), at(r, c + 1)});
  }
  return out;
}

TEST_CASE("a mesh that lacks what a method needs is refused with counts, before anything is written") {
  const TemporaryFolder folder;
  const auto said = [&](const std::vector<Face>& faces, Needs needs) {
    const auto mesh = over_ten(faces);
    const Toy method("toy", {"mesh"}, needs);
    const std::string fault = lacking(method.info(), *mesh);
    const std::string path = folder / "a.lod";
    if (fault.empty()) {
      CHECK_NOTHROW(build_store(*mesh, method, {}, path, BuildMode::kForce, {}));
    } else {
      const auto build = [&] { build_store(*mesh, method, {}, path, BuildMode::kNew, {}); };
      std::filesystem::remove(path);
      CHECK(message_of<InvalidInput>(build) == "build: " + fault);
      CHECK(folder.files() == 0);
    }
    return fault;
  };
  const std::vector<Face> tetrahedron{{0, 2, 1}, {0, 1, 4}, {1, 2, 4}, {0, 4, 2}};
  std::vector<Face> open(tetrahedron.begin() + 1, tetrahedron.end()), fin = tetrahedron, turned = open;
  fin.push_back({0, 1, 6});
  std::swap(turned[0][0], turned[0][1]);
  for (const Needs needs : {Needs::kAnything, Needs::kManifold, Needs::kClosed, Needs::kGenusZero})
    CHECK(said(tetrahedron, needs).empty());
  CHECK(said(fin, Needs::kAnything).empty());
  for (const Needs needs : {Needs::kManifold, Needs::kClosed, Needs::kGenusZero})
    CHECK(says(said(fin, needs), "it has 1 edges of three triangles or more, 0 vertices of several fans"));
  CHECK(says(said(turned, Needs::kManifold), "is not oriented alike"));
  CHECK(said(open, Needs::kManifold).empty());
  CHECK(said(open, Needs::kClosed) == "method toy needs a closed mesh: this one has 3 edges of one triangle");
  CHECK(said(torus(), Needs::kClosed).empty());
  CHECK(said(torus(), Needs::kGenusZero) == "method toy needs a mesh of genus 0: the genus is 1");
  CHECK(says(said({{0, 9, 1}}, Needs::kManifold), "none of its triangles has corners at three positions"));
  std::vector<Face> seam = tetrahedron;  // one corner by its other name: closed where positions count
  seam[3][0] = 9;
  CHECK(said(seam, Needs::kGenusZero).empty());
}

TEST_CASE("an interrupted build is resumed where it stopped") {
  const TemporaryFolder folder;
  const std::string path = folder / "a.lod";
  const auto whole = build_store(small_field(), toy(), {}, folder / "b.lod", BuildMode::kNew, {});
  const Progress stop = [](const std::string&, double share) {
    if (share > 0.45) throw Interrupted();
  };
  CHECK_THROWS_AS(build_store(small_field(), toy(), {}, path, BuildMode::kNew, stop), Interrupted);
  const std::string message = store_error([&] { Store::open(path); });
  CHECK_MESSAGE(says(message, "interrupted at pages 50 %"), message);
  const int before = toy().put;
  const auto store = build_store(small_field(), toy(), {}, path, BuildMode::kResume, {});
  CHECK(toy().put - before == 5);
  CHECK(store->content_hash() == whole->content_hash());
}
