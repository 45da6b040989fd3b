// A `ros2_control` SystemInterface for the actuator, through the socket of `rigctl serve` (docs/how-to/integrate.md).
//
// One prismatic joint: state interfaces `position` (m), `velocity` (m/s) and `effort` (estimated load, N); command interfaces
// `position` (m) and, if a controller claims it, `velocity` (m/s, with its sign). Written for Humble and Jazzy, and compiled
// against stand-ins of their headers only. A test reads the orders in its raw strings and sends them to the server.

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include <hardware_interface/system_interface.hpp>
#include <hardware_interface/types/hardware_interface_type_values.hpp>
#include <nlohmann/json.hpp>
#include <pluginlib/class_list_macros.hpp>

namespace tsa_rig {
using hardware_interface::CallbackReturn;
using hardware_interface::return_type;

class RigSystem : public hardware_interface::SystemInterface {
 public:
  CallbackReturn on_init(const hardware_interface::HardwareInfo& info) override {
    if (SystemInterface::on_init(info) != CallbackReturn::SUCCESS || info.joints.size() != 1) return CallbackReturn::ERROR;
    socket_path_ = info.hardware_parameters.at("socket");
    joint_ = info.joints[0].name;
    return CallbackReturn::SUCCESS;
  }

  std::vector<hardware_interface::StateInterface> export_state_interfaces() override {
    std::vector<hardware_interface::StateInterface> states;
    states.emplace_back(joint_, hardware_interface::HW_IF_POSITION, &position_m_);
    states.emplace_back(joint_, hardware_interface::HW_IF_VELOCITY, &velocity_m_per_s_);
    states.emplace_back(joint_, hardware_interface::HW_IF_EFFORT, &load_n_);
    return states;
  }

  std::vector<hardware_interface::CommandInterface> export_command_interfaces() override {
    std::vector<hardware_interface::CommandInterface> commands;
    commands.emplace_back(joint_, hardware_interface::HW_IF_POSITION, &target_m_);
    commands.emplace_back(joint_, hardware_interface::HW_IF_VELOCITY, &speed_m_per_s_);
    return commands;
  }

  // Connects, and waits for the position of a homed rig.
  CallbackReturn on_activate(const rclcpp_lifecycle::State&) override {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (socket_path_.size() >= sizeof(address.sun_path)) return CallbackReturn::ERROR;
    socket_path_.copy(address.sun_path, sizeof(address.sun_path) - 1);
    socket_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0);
    if (::connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0) return CallbackReturn::ERROR;
    input_.clear();
    position_m_ = target_m_ = std::nan("");
    for (int tries = 0; tries < 100 && std::isnan(position_m_); ++tries) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      if (receive() != return_type::OK) return CallbackReturn::ERROR;
    }
    // Without a position the rig is not homed. The first command is to stay.
    sent_m_ = target_m_ = position_m_;
    return std::isnan(position_m_) ? CallbackReturn::ERROR : CallbackReturn::SUCCESS;
  }

  CallbackReturn on_deactivate(const rclcpp_lifecycle::State&) override {
    const bool stopped = send(R"({"do": "stop"})") == return_type::OK;
    ::close(socket_);
    return stopped ? CallbackReturn::SUCCESS : CallbackReturn::ERROR;
  }

  return_type read(const rclcpp::Time&, const rclcpp::Duration&) override { return receive(); }

  return_type write(const rclcpp::Time&, const rclcpp::Duration& period) override {
    // One set-point in each cycle; the rig holds the load when they stop. Without a velocity it is that of the positions.
    if (std::isnan(target_m_)) return return_type::OK;
    const double speed = std::isnan(speed_m_per_s_) ? (target_m_ - sent_m_) / period.seconds() : speed_m_per_s_;
    char line[128];
    std::snprintf(line, sizeof(line), R"({"do": "track", "position_m": %.7f, "speed_m_per_s": %.7f})", target_m_, speed);
    sent_m_ = target_m_;
    return send(line);
  }

 private:
  // Takes every line that has come.
  return_type receive() {
    char bytes[4096];
    ssize_t count;
    while ((count = ::recv(socket_, bytes, sizeof(bytes), 0)) > 0) input_.append(bytes, static_cast<size_t>(count));
    if (count == 0 || (errno != EAGAIN && errno != EWOULDBLOCK)) return return_type::ERROR;
    for (size_t end; (end = input_.find('\n')) != std::string::npos; input_.erase(0, end + 1)) {
      const auto line = nlohmann::json::parse(input_.substr(0, end), nullptr, false);
      if (line.is_discarded() || !take(line)) return return_type::ERROR;
    }
    return return_type::OK;
  }

  // A fault or a refused order is an error, which deactivates the hardware; `message` says why.
  bool take(const nlohmann::json& line) {
    if (line.contains("hello")) gear_ratio_ = line["hello"]["gear_ratio"];
    if (line.contains("error")) {
      std::fprintf(stderr, "rig: %s\n", line["error"].dump().c_str());
      return false;
    }
    if (!line.contains("t_s")) return true;
    if (!line["fault"].is_null()) {
      std::fprintf(stderr, "rig: fault %s\n", line["fault"].dump().c_str());
      return false;
    }
    position_m_ = number(line["position_m"]);
    velocity_m_per_s_ = number(line["drive_speed_rad_per_s"]) / gear_ratio_ / number(line["tr_rad_per_m"]);
    load_n_ = number(line["load_n"]);
    return true;
  }

  static double number(const nlohmann::json& value) { return value.is_number() ? value.get<double>() : std::nan(""); }

  return_type send(const std::string& line) {
    const std::string text = line + "\n";
    const auto count = ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
    return count == static_cast<ssize_t>(text.size()) ? return_type::OK : return_type::ERROR;
  }

  std::string socket_path_, joint_, input_;
  int socket_ = -1;
  double gear_ratio_ = std::nan(""), sent_m_ = std::nan("");
  double position_m_ = std::nan(""), velocity_m_per_s_ = std::nan(""), load_n_ = std::nan("");
  double target_m_ = std::nan(""), speed_m_per_s_ = std::nan("");
};
}  // namespace tsa_rig

PLUGINLIB_EXPORT_CLASS(tsa_rig::RigSystem, hardware_interface::SystemInterface)
