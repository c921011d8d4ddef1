// What the docs' controller uses of ros2_control, declared as far as a compiler needs it.
#pragma once

#include <string>
#include <vector>

namespace rclcpp {
class Time {};
class Duration {};
}  // namespace rclcpp

namespace rclcpp_lifecycle {
class State {};
}  // namespace rclcpp_lifecycle

namespace controller_interface {

enum class return_type { OK, ERROR };
enum class CallbackReturn { SUCCESS, FAILURE, ERROR };
enum class interface_configuration_type { ALL, INDIVIDUAL, NONE };

struct InterfaceConfiguration {
  interface_configuration_type type;
  std::vector<std::string> names;
};

struct StateInterface {
  double get_value() const { return 0; }
};

struct CommandInterface {
  void set_value(double) {}
};

class ControllerInterface {
 public:
  virtual ~ControllerInterface() = default;
  virtual CallbackReturn on_init() = 0;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State&) { return CallbackReturn::SUCCESS; }
  virtual return_type update(const rclcpp::Time&, const rclcpp::Duration&) = 0;

 protected:
  std::vector<CommandInterface> command_interfaces_;
  std::vector<StateInterface> state_interfaces_;
};

}  // namespace controller_interface
