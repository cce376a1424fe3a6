#include "config/yaml.h"

#include <yaml-cpp/yaml.h>

#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

namespace vantage::config {
namespace {

[[noreturn]] void Throw(const std::string& file, int line, const std::string& message) {
  throw std::runtime_error(file + ":" + std::to_string(line) + ": " + message);
}

int LineOf(const YAML::Node& node, int otherwise) {
  const YAML::Mark mark = node.Mark();
  return mark.is_null() ? otherwise : mark.line + 1;
}

// What a person would call the node, for error messages.
std::string Describe(const YAML::Node& node) {
  switch (node.Type()) {
    case YAML::NodeType::Scalar:
      return "'" + node.Scalar() + "'";
    case YAML::NodeType::Sequence:
      return "a list of " + std::to_string(node.size());
    case YAML::NodeType::Map:
      return "a mapping";
    default:
      return "nothing";
  }
}

bool IsPlainScalar(const YAML::Node& node) { return node.IsScalar() && node.Tag() != "!"; }  // "!" marks a quoted string.

// The whole scalar as a number, in decimal; YAML 1.1's octal 010 and hexadecimal are not numbers here.
template <typename Number>
bool ToNumber(const YAML::Node& node, Number& value) {
  if (!IsPlainScalar(node)) return false;
  const std::string& text = node.Scalar();
  const char* first = text.data();
  const char* last = first + text.size();
  if (last - first > 1 && first[0] == '+' && first[1] != '-') ++first;
  Number read{};
  const auto [end, error] = std::from_chars(first, last, read);
  if (error != std::errc() || end != last) return false;
  if constexpr (std::is_floating_point_v<Number>) {
    if (!std::isfinite(read)) return false;
  }
  value = read;
  return true;
}

bool ToBool(const YAML::Node& node, bool& value) {
  if (!IsPlainScalar(node)) return false;
  const std::string& text = node.Scalar();
  if (text != "true" && text != "false") return false;
  value = text == "true";
  return true;
}

bool ToDoubles(const YAML::Node& node, std::vector<double>& values) {
  if (!node.IsSequence()) return false;
  std::vector<double> read(node.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    if (!ToNumber(node[i], read[i])) return false;
  }
  values = std::move(read);
  return true;
}

bool ToStrings(const YAML::Node& node, std::vector<std::string>& values) {
  if (!node.IsSequence()) return false;
  std::vector<std::string> read;
  for (const YAML::Node& item : node) {
    if (!item.IsScalar()) return false;
    read.push_back(item.Scalar());
  }
  values = std::move(read);
  return true;
}

}  // namespace

struct Mapping::Impl {
  struct Entry {
    YAML::Node value;
    int line = 1;
  };

  std::string file;
  int line = 1;
  std::map<std::string, Entry> entries;
  std::set<std::string> asked;

  Impl(std::string file_name, int first_line, const YAML::Node& node) : file(std::move(file_name)), line(first_line) {
    if (!node.IsDefined() || node.IsNull()) return;
    line = LineOf(node, first_line);
    if (!node.IsMap()) Throw(file, line, "expected a mapping (key: value), found " + Describe(node));
    for (const auto& item : node) {
      const int key_line = LineOf(item.first, line);
      if (!item.first.IsScalar()) Throw(file, key_line, "expected a name as key, found " + Describe(item.first));
      const auto [entry, is_new] = entries.emplace(item.first.Scalar(), Entry{item.second, key_line});
      if (!is_new) {
        Throw(file, key_line, "key '" + entry->first + "' was given already in line " + std::to_string(entry->second.line));
      }
    }
  }

  // The entry, remembering that the key is known; nullptr where it is absent.
  const Entry* Find(const std::string& key) {
    asked.insert(key);
    const auto entry = entries.find(key);
    return entry == entries.end() ? nullptr : &entry->second;
  }

  template <typename Value, typename Convert>
  void Read(const std::string& key, Value& value, const char* expected, const Convert& convert) {
    const Entry* entry = Find(key);
    if (entry != nullptr && !convert(entry->value, value)) {
      Throw(file, entry->line, key + " must be " + expected + ", is " + Describe(entry->value));
    }
  }
};

Mapping Mapping::Load(const std::filesystem::path& file) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored))
    throw std::runtime_error(file.string() + ": expected a YAML file, found a folder");
  std::ifstream stream(file);
  if (!stream) throw std::runtime_error(file.string() + ": cannot open this file; give the path of a YAML file that can be read");
  std::ostringstream text;
  text << stream.rdbuf();
  return Parse(text.str(), file.string());
}

Mapping Mapping::Parse(const std::string& text, const std::string& name) {
  std::vector<YAML::Node> documents;
  try {
    documents = YAML::LoadAll(text);
  } catch (const YAML::Exception& error) {
    Throw(name, error.mark.is_null() ? 1 : error.mark.line + 1, "broken YAML: " + error.msg);
  }
  if (documents.size() > 1) Throw(name, LineOf(documents[1], 1), "expected one YAML document, found a second one");
  Mapping mapping;
  mapping.impl_ = std::make_shared<Impl>(name, 1, documents.empty() ? YAML::Node() : documents[0]);
  return mapping;
}

bool Mapping::Has(const std::string& key) const { return impl_->Find(key) != nullptr; }

void Mapping::Get(const std::string& key, bool& value) { impl_->Read(key, value, "true or false", ToBool); }

void Mapping::Get(const std::string& key, int& value) { impl_->Read(key, value, "an integer", ToNumber<int>); }

void Mapping::Get(const std::string& key, std::uint32_t& value) {
  impl_->Read(key, value, "an integer from 0 to 4294967295", ToNumber<std::uint32_t>);
}

void Mapping::Get(const std::string& key, double& value) { impl_->Read(key, value, "a finite number", ToNumber<double>); }

void Mapping::Get(const std::string& key, std::string& value) {
  impl_->Read(key, value, "a text", [](const YAML::Node& node, std::string& text) {
    if (!node.IsScalar()) return false;
    text = node.Scalar();
    return true;
  });
}

void Mapping::Get(const std::string& key, Eigen::Vector3d& value) {
  impl_->Read(key, value, "a list of 3 finite numbers", [](const YAML::Node& node, Eigen::Vector3d& vector) {
    std::vector<double> numbers;
    if (!ToDoubles(node, numbers) || numbers.size() != 3) return false;
    vector = Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
    return true;
  });
}

void Mapping::Get(const std::string& key, std::vector<double>& value) {
  impl_->Read(key, value, "a list of finite numbers", ToDoubles);
}

void Mapping::Get(const std::string& key, std::vector<std::string>& value) {
  impl_->Read(key, value, "a list of texts", ToStrings);
}

Mapping Mapping::Child(const std::string& key) {
  const Impl::Entry* entry = impl_->Find(key);
  Mapping child;
  child.impl_ = entry == nullptr ? std::make_shared<Impl>(impl_->file, impl_->line, YAML::Node())
                                 : std::make_shared<Impl>(impl_->file, entry->line, entry->value);
  return child;
}

std::vector<Mapping> Mapping::Children(const std::string& key) {
  const Impl::Entry* entry = impl_->Find(key);
  if (entry == nullptr || entry->value.IsNull()) return {};
  if (!entry->value.IsSequence()) {
    Throw(impl_->file, entry->line, key + " must be a list of mappings, is " + Describe(entry->value));
  }
  std::vector<Mapping> children;
  for (const YAML::Node& item : entry->value) {
    Mapping child;
    child.impl_ = std::make_shared<Impl>(impl_->file, LineOf(item, entry->line), item);
    children.push_back(std::move(child));
  }
  return children;
}

void Mapping::Finish() const {
  const std::pair<const std::string, Impl::Entry>* first = nullptr;
  for (const auto& entry : impl_->entries) {
    if (impl_->asked.count(entry.first) > 0) continue;
    if (first == nullptr || entry.second.line < first->second.line) first = &entry;
  }
  if (first == nullptr) return;
  std::string known;
  for (const std::string& key : impl_->asked) known += (known.empty() ? "" : ", ") + key;
  Throw(impl_->file, first->second.line,
        "unknown key '" + first->first + "'; " + (known.empty() ? "no keys are known here" : "known keys: " + known));
}

void Mapping::Fail(const std::string& key, const std::string& message) const {
  const auto entry = impl_->entries.find(key);
  const int line = entry == impl_->entries.end() ? impl_->line : entry->second.line;
  Throw(impl_->file, line, key.empty() ? message : key + ": " + message);
}

}  // namespace vantage::config
