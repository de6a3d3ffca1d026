#include "io/gltf_appearance.h"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include "io/file_error.h"

namespace sinew {
namespace {

using nlohmann::json;

constexpr std::size_t kMostElements = 50'000;  // of one array
constexpr std::uint64_t kLargestImage = std::uint64_t{256} << 20;

/// By the first bytes, which do not lie as names do.
std::string sniffed_mime_type(std::span<const std::byte> bytes) {
  const std::string_view start(reinterpret_cast<const char*>(bytes.data()),
                               std::min<std::size_t>(bytes.size(), 12));
  if (start.starts_with("\x89PNG")) return "image/png";
  if (start.starts_with("\xFF\xD8\xFF")) return "image/jpeg";
  if (start.starts_with("RIFF") && start.size() == 12 && start.substr(8) == "WEBP") return "image/webp";
  if (start.starts_with("\xABKTX 20")) return "image/ktx2";
  return "";
}

std::string file_name_of(const std::string& uri) {
  return uri.substr(uri.find_last_of('/') + 1);
}

SourceImage read_image(const JsonPlace& image, const AssetFolder& folder, const ViewBytes& view_bytes,
                       std::size_t view_count) {
  SourceImage result;
  result.name = image.text_or("name", "");
  if (const auto view = image.find("bufferView")) {
    const std::span<const std::byte> bytes = view_bytes(view->index_below(view_count, "buffer views"));
    result.bytes.assign(bytes.begin(), bytes.end());
  } else {
    const JsonPlace uri = image.member("uri");
    if (is_data_uri(uri.text())) {
      DataUri data = decode_data_uri(uri.text(), uri.where());
      result.bytes = std::move(data.bytes);
      result.mime_type = std::move(data.mime_type);
    } else {
      result.bytes = folder.read_up_to(uri.text(), kLargestImage, uri.where());
      if (result.name.empty()) result.name = file_name_of(uri.text());
    }
  }
  const std::string sniffed = sniffed_mime_type(result.bytes);
  if (!sniffed.empty()) result.mime_type = sniffed;
  if (result.mime_type.empty()) result.mime_type = image.text_or("mimeType", "");
  if (result.bytes.empty()) image.fail("image has no bytes");
  return result;
}

/// Which index each kept thing gets; nothing for one that is left out.
using Renumbering = std::vector<std::optional<int>>;

class AppearanceReader {
 public:
  AppearanceReader(const JsonPlace& root, const AssetFolder& folder, const ViewBytes& view_bytes)
      : root_(root), folder_(folder), view_bytes_(view_bytes) {}

  GltfAppearance read() {
    if (count_of("materials") == 0) return {};
    for (const char* key : {"materials", "textures", "samplers", "images"}) check_size(key);
    read_images();
    read_textures();
    if (count_of("samplers") > 0) kept_["samplers"] = root_.member("samplers").value();
    json materials = root_.member("materials").value();
    for (std::size_t i = 0; i < materials.size(); ++i)
      renumber_textures(materials[i], root_.member("materials").element(i));
    kept_["materials"] = std::move(materials);
    note_extensions();
    if (lost_ > 0) {
      result_.warnings.push_back("W_GLTF_IMAGE: " + std::to_string(lost_) +
                                 " image(s) left out of the materials; the first: " + first_loss_);
    }
    result_.json = kept_.dump();
    return std::move(result_);
  }

 private:
  std::size_t count_of(const char* key) const { return root_.has(key) ? root_.member(key).array_size() : 0; }

  void check_size(const char* key) const {
    if (count_of(key) <= kMostElements) return;
    throw FileError(FileFault::resource, root_.member(key).where(),
                    "has " + std::to_string(count_of(key)) + " elements; at most " +
                        std::to_string(kMostElements) + " are read");
  }

  void read_images() {
    image_index_.resize(count_of("images"));
    for (std::size_t i = 0; i < image_index_.size(); ++i) {
      const JsonPlace image = root_.member("images").element(i);
      image.expect_object();
      try {
        result_.images.push_back(read_image(image, folder_, view_bytes_, count_of("bufferViews")));
      } catch (const FileError& error) {  // a texture out of reach does not make the body unusable
        if (lost_++ == 0) first_loss_ = error.what();
        continue;
      }
      image_index_[i] = static_cast<int>(result_.images.size()) - 1;
      json entry = image.value();
      for (const char* key : {"uri", "bufferView"}) entry.erase(key);
      entry["source"] = *image_index_[i];
      entry["mimeType"] = result_.images.back().mime_type;
      kept_["images"].push_back(std::move(entry));
    }
  }

  /// Renumbers "source" in the texture and in its extensions. False when no source is left.
  bool renumber_sources(json& texture, const JsonPlace& place) const {
    bool any = false;
    const auto renumber = [&](json& holder, const JsonPlace& at) {
      const auto source = at.find("source");
      if (!source) return;
      const auto index = image_index_[source->index_below(image_index_.size(), "images")];
      if (index)
        holder["source"] = *index;
      else
        holder.erase("source");
      any = any || index.has_value();
    };
    renumber(texture, place);
    if (const auto extensions = place.find("extensions")) {
      extensions->expect_object();
      for (const auto& [name, unused] : extensions->value().items()) {
        renumber(texture["extensions"][name], extensions->member(name));
      }
    }
    return any;
  }

  void read_textures() {
    texture_index_.resize(count_of("textures"));
    for (std::size_t i = 0; i < texture_index_.size(); ++i) {
      const JsonPlace place = root_.member("textures").element(i);
      place.expect_object();
      place.index_or_none("sampler", count_of("samplers"), "samplers");
      json texture = place.value();
      if (!renumber_sources(texture, place)) continue;
      kept_["textures"].push_back(std::move(texture));
      texture_index_[i] = static_cast<int>(kept_["textures"].size()) - 1;
    }
  }

  /// Texture references are the members called ...Texture, in materials and in their extensions alike.
  void renumber_textures(json& holder, const JsonPlace& place) const {
    if (!holder.is_object()) return;
    std::vector<std::string> gone;
    for (auto& [key, value] : holder.items()) {
      if (key == "extras" || !value.is_object()) continue;
      const JsonPlace at = place.member(key);
      const bool reference = key.ends_with("Texture") && value.contains("index");
      if (!reference) {
        renumber_textures(value, at);
        continue;
      }
      const auto index = texture_index_[at.member("index").index_below(texture_index_.size(), "textures")];
      if (index)
        value["index"] = *index;
      else
        gone.push_back(key);
    }
    for (const std::string& key : gone) holder.erase(key);
  }

  static void collect_extensions(const json& value, std::set<std::string>& names) {
    for (const auto& [key, member] : value.items()) {
      if (key == "extras") continue;
      if (key == "extensions" && member.is_object()) {
        for (const auto& [name, unused] : member.items()) names.insert(name);
      }
      if (member.is_structured()) collect_extensions(member, names);
    }
  }

  void note_extensions() {
    std::set<std::string> names;
    collect_extensions(kept_, names);
    if (!names.empty()) kept_["extensionsUsed"] = names;
  }

  const JsonPlace& root_;
  const AssetFolder& folder_;
  const ViewBytes& view_bytes_;
  json kept_ = json::object();
  GltfAppearance result_;
  Renumbering image_index_;
  Renumbering texture_index_;
  int lost_ = 0;
  std::string first_loss_;
};

}  // namespace

GltfAppearance read_gltf_appearance(const JsonPlace& root, const AssetFolder& folder,
                                    const ViewBytes& view_bytes) {
  return AppearanceReader(root, folder, view_bytes).read();
}

}  // namespace sinew
