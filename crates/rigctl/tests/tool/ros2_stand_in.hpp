// What rig_system.cpp uses of ROS 2 (Humble and Jazzy) and of nlohmann/json, with their signatures and nothing behind them.
#pragma once

#include <cstddef>
#include <string>
#include <type_traits>
#include <unordered_map>
#include <vector>

namespace rclcpp {
class Time {};
class Duration {
 public:
  double seconds() const { return 0.0; }
};
}  // namespace rclcpp

namespace rclcpp_lifecycle {
class State {};
}  // namespace rclcpp_lifecycle

namespace hardware_interface {
constexpr char HW_IF_POSITION[] = "position";
constexpr char HW_IF_VELOCITY[] = "velocity";
constexpr char HW_IF_EFFORT[] = "effort";

enum class CallbackReturn { SUCCESS, FAILURE, ERROR };
enum class return_type { OK, ERROR };

struct ComponentInfo {
  std::string name;
};
struct HardwareInfo {
  std::unordered_map<std::string, std::string> hardware_parameters;
  std::vector<ComponentInfo> joints;
};

class StateInterface {
 public:
  StateInterface(const std::string&, const std::string&, double*) {}
};
class CommandInterface {
 public:
  CommandInterface(const std::string&, const std::string&, double*) {}
};

class SystemInterface {
 public:
  virtual ~SystemInterface() = default;
  virtual CallbackReturn on_init(const HardwareInfo&) { return CallbackReturn::SUCCESS; }
  virtual std::vector<StateInterface> export_state_interfaces() = 0;
  virtual std::vector<CommandInterface> export_command_interfaces() = 0;
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State&) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State&) { return CallbackReturn::SUCCESS; }
  virtual return_type read(const rclcpp::Time&, const rclcpp::Duration&) = 0;
  virtual return_type write(const rclcpp::Time&, const rclcpp::Duration&) = 0;
};
}  // namespace hardware_interface

namespace nlohmann {
class json {
 public:
  static json parse(const std::string&, std::nullptr_t, bool) { return {}; }
  bool is_discarded() const { return false; }
  bool is_null() const { return true; }
  bool is_number() const { return false; }
  bool contains(const char*) const { return false; }
  const json& operator[](const char*) const { return *this; }
  std::string dump() const { return {}; }
  template <typename T>
  T get() const { return {}; }
  operator double() const { return 0.0; }
};
}  // namespace nlohmann

// pluginlib makes the class without arguments, as its base. The names stay in the library for the test.
#define PLUGINLIB_EXPORT_CLASS(type, base)                                     \
  static_assert(std::is_base_of<base, type>::value, #type " is no " #base);    \
  extern "C" base* stand_in_make() { return new type(); }                      \
  extern "C" const char* stand_in_names() { return "exports " #type " as " #base; }
