//! The package of `examples/ros2_control`: built by its own CMakeLists.txt with stand-ins for ROS 2, which no machine of the project
//! has; and whether its files name the same things.

use crate::common::{folder, root, text};
use std::path::Path;
use std::process::Command;

/// What the package finds: the calls of ROS 2's CMake that it makes, and the headers.
const FOUND: [(&str, &str); 5] = [
    (
        "ament_cmake",
        "macro(ament_package)\nendmacro()
         function(ament_target_dependencies target)
           foreach(package ${ARGN})
             if(NOT package STREQUAL PUBLIC AND NOT ${package}_FOUND)
               message(FATAL_ERROR \"${package} was not found\")
             endif()
           endforeach()
           target_include_directories(${target} PRIVATE ${CMAKE_PREFIX_PATH}/include)
         endfunction()",
    ),
    ("hardware_interface", ""),
    (
        "pluginlib",
        "function(pluginlib_export_plugin_description_file base file)
           install(FILES ${file} DESTINATION share/${PROJECT_NAME}/${base})
         endfunction()",
    ),
    ("rclcpp_lifecycle", ""),
    ("nlohmann_json", "add_library(nlohmann_json::nlohmann_json INTERFACE IMPORTED)"),
];
const HEADERS: [&str; 4] = [
    "hardware_interface/system_interface.hpp",
    "hardware_interface/types/hardware_interface_type_values.hpp",
    "nlohmann/json.hpp",
    "pluginlib/class_list_macros.hpp",
];

fn package(name: &str) -> String {
    std::fs::read_to_string(root().join("examples/ros2_control").join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn write(path: &Path, text: &str) {
    std::fs::create_dir_all(path.parent().expect("a folder"))
        .and_then(|()| std::fs::write(path, text))
        .expect("written");
}

/// What stands between two texts, each time.
fn between<'t>(text: &'t str, before: &str, after: &str) -> Vec<&'t str> {
    text.split(before).skip(1).map(|rest| rest.split(after).next().unwrap_or_default()).collect()
}

fn only<'t>(text: &'t str, before: &str, after: &str) -> &'t str {
    let found = between(text, before, after);
    let [one] = found[..] else { panic!("{before:?}: {found:?}") };
    one
}

#[test]
fn the_package_is_built_and_its_library_exports_the_class_of_its_description() {
    if Command::new("cmake").arg("--version").output().is_err() {
        println!("not tested: there is no cmake");
        return;
    }
    let (stand_ins, built, installed) = (folder("ros2-stand-ins"), folder("ros2-built"), folder("ros2-installed"));
    for (name, calls) in FOUND {
        write(&stand_ins.join(format!("lib/cmake/{name}/{name}Config.cmake")), calls);
    }
    write(&stand_ins.join("include/stand_in.hpp"), include_str!("ros2_stand_in.hpp"));
    for name in HEADERS {
        write(&stand_ins.join("include").join(name), "#include <stand_in.hpp>\n");
    }
    let cmake = |arguments: &[&str]| {
        let done = Command::new("cmake").args(arguments).output().expect("cmake runs");
        let said = [done.stdout, done.stderr].map(|said| String::from_utf8_lossy(&said).into_owned()).concat();
        assert!(done.status.success(), "cmake {arguments:?}: {said}");
    };
    let prefix = format!("-DCMAKE_PREFIX_PATH={}", text(&stand_ins));
    let into = format!("-DCMAKE_INSTALL_PREFIX={}", text(&installed));
    let flags = "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Werror";
    let source = root().join("examples/ros2_control");
    cmake(&["-S", text(&source), "-B", text(&built), &prefix, &into, flags]);
    cmake(&["--build", text(&built), "--target", "install"]);

    // Where and as what pluginlib looks for it.
    let plugin =
        std::fs::read_to_string(installed.join("share/tsa_rig/hardware_interface/plugin.xml")).expect("installed");
    let path = only(&plugin, "<library path=\"", "\"");
    let library = std::fs::read(installed.join(format!("lib/lib{path}.so"))).expect("the library of the description");
    let [class, base] = [" type=\"", "base_class_type=\""].map(|key| only(&plugin, key, "\""));
    let exported = format!("exports {class} as {base}\0");
    assert!(library.windows(exported.len()).any(|bytes| bytes == exported.as_bytes()), "{exported}");
    assert!(installed.join("share/tsa_rig/rig.urdf.xml").exists());
}

#[test]
fn the_files_of_the_package_name_the_same_things() {
    let [manifest, cmake, plugin, urdf, source] =
        ["package.xml", "CMakeLists.txt", "plugin.xml", "rig.urdf.xml", "rig_system.cpp"].map(package);
    let name = only(&manifest, "<name>", "</name>");
    assert_eq!(only(&cmake, "project(", " "), name);
    assert_eq!(only(&manifest, "<version>", "</version>"), env!("CARGO_PKG_VERSION"));
    let class = only(&plugin, "class name=\"", "\"");
    assert!(class.starts_with(&format!("{name}/")), "{class}");
    assert_eq!(only(&urdf, "<plugin>", "</plugin>"), class);
    assert_eq!(only(&urdf, "<param name=\"", "\""), only(&source, "hardware_parameters.at(\"", "\""));
    // What CMake finds, under the names that rosdep knows.
    let needed: Vec<_> =
        manifest.lines().filter_map(|line| Some(line.split_once("depend>")?.1.split_once('<')?.0)).collect();
    let found = between(&cmake, "find_package(", " ");
    assert_eq!(needed.join(" ").replace("nlohmann-json-dev", "nlohmann_json"), found.join(" "));
    for (kind, list) in [("state", "states"), ("command", "commands")] {
        let exported = between(&source, &format!("{list}.emplace_back(joint_, hardware_interface::HW_IF_"), ",");
        let described = between(&urdf, &format!("<{kind}_interface name=\""), "\"");
        assert_eq!(exported.join(" ").to_lowercase(), described.join(" "), "{kind} interfaces");
    }
}
