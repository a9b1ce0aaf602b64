#include "cli/view/script.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "core/base/text.h"

namespace lightloom::view {
namespace {

constexpr float kAny = std::numeric_limits<float>::max();

/// Arguments: a letter each. n: number; t: text; o: overlay; l: layer; b: on or off.
struct Form {
  const char* word;
  const char* arguments;
  Verb verb;
  const char* shown;
  float least = -kAny, greatest = kAny;  ///< of its numbers
};

constexpr Form kForms[] = {
    {"wait", "n", Verb::kWait, "wait FRAMES", 1, 100000},
    {"wait-bake", "", Verb::kWaitBake, "wait-bake"},
    {"wait-reload", "", Verb::kWaitReload, "wait-reload"},
    {"wait-arrival", "", Verb::kWaitArrival, "wait-arrival"},
    {"camera", "nnnnn", Verb::kCamera, "camera x y z yaw pitch"},
    {"camera", "t", Verb::kCameraNamed, "camera NAME"},
    {"light", "tnnn", Verb::kLight, "light NAME x y z"},
    {"light-colour", "tnnn", Verb::kLightColour, "light-colour NAME r g b", 0},
    {"light-power", "tn", Verb::kLightPower, "light-power NAME W", 0},
    {"pick", "t", Verb::kPick, "pick OBJECT"},
    {"click", "nn", Verb::kClick, "click x y", 0, 1},
    {"albedo", "nnn", Verb::kAlbedo, "albedo r g b", 0, 1},
    {"emission", "nnn", Verb::kEmission, "emission r g b", 0},
    {"move", "nnn", Verb::kMove, "move dx dy dz"},
    {"duplicate", "", Verb::kDuplicate, "duplicate"},
    {"delete", "", Verb::kDelete, "delete"},
    {"save", "t", Verb::kSave, "save FILE.glb"},
    {"rebake", "", Verb::kRebake, "rebake"},
    {"cancel-bake", "", Verb::kCancelBake, "cancel-bake"},
    {"reload", "", Verb::kReload, "reload"},
    {"overlay", "ob", Verb::kOverlay, "overlay NAME on|off"},
    {"layer", "l", Verb::kLayer, "layer NAME"},
    {"exposure", "n", Verb::kExposure, "exposure FACTOR", 0},
    {"resize", "nn", Verb::kResize, "resize WIDTH HEIGHT", 64, 16384},
    {"screenshot", "t", Verb::kScreenshot, "screenshot FILE.png"},
    {"quit", "", Verb::kQuit, "quit"},
};

absl::StatusOr<std::vector<std::string>> words_of(std::string_view line) {
  std::vector<std::string> words;
  for (size_t i = 0; i < line.size();) {
    const char c = line[i];
    if (c == '#') break;
    if (c == ' ' || c == '\t' || c == '\r') {
      ++i;
    } else if (c == '"') {
      const size_t end = line.find('"', i + 1);
      if (end == line.npos) return absl::InvalidArgumentError("a quote is not closed");
      words.emplace_back(line.substr(i + 1, end - i - 1));
      i = end + 1;
    } else {
      const size_t end = std::min(line.find_first_of(" \t\r", i), line.size());
      words.emplace_back(line.substr(i, end - i));
      i = end;
    }
  }
  return words;
}

template <size_t N>
absl::Status one_of(const char* const (&known)[N], const std::string& word, const char* what) {
  std::string all;
  for (const char* name : known) {
    if (word == name) return absl::OkStatus();
    all += (all.empty() ? "" : ", ") + std::string(name);
  }
  return absl::InvalidArgumentError(absl::StrCat("there is no ", what, " '", printable(word), "'; there are ", all));
}

absl::StatusOr<float> number(const Form& form, const std::string& word) {
  float value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value)) {
    return absl::InvalidArgumentError(absl::StrCat("'", printable(word), "' is not a number: ", form.shown));
  }
  if (value < form.least || value > form.greatest) {
    const std::string range =
        form.greatest == kAny ? absl::StrCat("at least ", form.least) : absl::StrCat(form.least, " to ", form.greatest);
    return absl::InvalidArgumentError(absl::StrCat("'", printable(word), "' must be ", range, ": ", form.shown));
  }
  return value;
}

absl::Status read_argument(const Form& form, char kind, const std::string& word, Action* action) {
  switch (kind) {
    case 'n': {
      LL_ASSIGN_OR_RETURN(const float value, number(form, word));
      action->numbers.push_back(value);
      return absl::OkStatus();
    }
    case 'b':
      if (word != "on" && word != "off") return absl::InvalidArgumentError("it must be on or off: overlay NAME on|off");
      action->on = word == "on";
      return absl::OkStatus();
    case 'o':
      LL_RETURN_IF_ERROR(one_of(kOverlays, word, "overlay"));
      break;
    case 'l':
      LL_RETURN_IF_ERROR(one_of(kLayers, word, "layer"));
      break;
    default:
      if (word.empty()) return absl::InvalidArgumentError(absl::StrCat("a name is empty: ", form.shown));
      break;
  }
  action->name = word;
  return absl::OkStatus();
}

absl::Status check_files(const Action& action) {
  if (action.verb == Verb::kScreenshot && !action.name.ends_with(".png")) {
    return absl::InvalidArgumentError("a screenshot must end in .png");
  }
  if (action.verb == Verb::kSave && !action.name.ends_with(".glb")) {
    return absl::InvalidArgumentError("a level is saved as .glb");
  }
  return absl::OkStatus();
}

absl::StatusOr<Action> parse_words(const std::vector<std::string>& words) {
  std::string named;
  for (const Form& form : kForms) {
    if (words[0] != form.word) continue;
    named += (named.empty() ? "" : " or ") + std::string(form.shown);
    const std::string_view kinds = form.arguments;
    if (kinds.size() != words.size() - 1) continue;
    Action action;
    action.verb = form.verb;
    for (size_t i = 0; i < kinds.size(); ++i) {
      LL_RETURN_IF_ERROR(read_argument(form, kinds[i], words[i + 1], &action));
    }
    LL_RETURN_IF_ERROR(check_files(action));
    return action;
  }
  if (!named.empty()) return absl::InvalidArgumentError(absl::StrCat("it must be: ", named));
  std::string all;
  for (const Form& form : kForms) {
    if (all.find(form.word) == all.npos) all += (all.empty() ? "" : ", ") + std::string(form.word);
  }
  return absl::InvalidArgumentError(absl::StrCat("'", printable(words[0]), "' is not a command; there are ", all));
}

}  // namespace

absl::StatusOr<std::vector<Action>> parse_script(std::string_view text) {
  std::vector<Action> actions;
  for (int number = 1; !text.empty(); ++number) {
    const size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const auto in_line = [&](const absl::Status& status) {
      return absl::InvalidArgumentError(absl::StrCat("line ", number, ": ", status.message()));
    };
    const auto words = words_of(line);
    if (!words.ok()) return in_line(words.status());
    if (words->empty()) continue;
    auto action = parse_words(*words);
    if (!action.ok()) return in_line(action.status());
    action->line = number;
    actions.push_back(*std::move(action));
  }
  return actions;
}

}  // namespace lightloom::view
