# SPDX-License-Identifier: Apache-2.0
# Included by tools/interfaces.py into the builds of msg_defs/ and vendor/*/ (CMAKE_PROJECT_INCLUDE),
# which by themselves are ordinary interface packages.

# What rclpy with Fast DDS uses, which registers types by their introspection: half of the
# time and of the size.
if(FOR_PYTHON_ONLY)
  find_package(ament_cmake REQUIRED)
  find_package(rosidl_default_generators REQUIRED)
  set(extensions "")
  file(MAKE_DIRECTORY "${CMAKE_BINARY_DIR}/generators")
  foreach(generator IN ITEMS
      rosidl_generator_type_description rosidl_generator_c rosidl_typesupport_fastrtps_c
      rosidl_typesupport_introspection_c rosidl_typesupport_c rosidl_generator_py)
    set(link "${CMAKE_BINARY_DIR}/generators/${generator}")
    file(CREATE_LINK "${CMAKE_CURRENT_LIST_DIR}/rosidl_generator.py" "${link}" SYMBOLIC)
    set(${generator}_BIN "${link}")
    list(APPEND extensions "${generator}:${generator}_generate_interfaces.cmake")
  endforeach()
  set(AMENT_EXTENSIONS_rosidl_generate_idl_interfaces ${extensions})
endif()

# Both functions run at the end, when all targets are there.

# Many ROS wheels export an include folder of the machine that built them; CMake then stops.
function(drop_missing_includes)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(includes ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(NOT includes)
      continue()
    endif()
    set(kept "")
    foreach(folder IN LISTS includes)
      if(folder MATCHES "\\$<" OR EXISTS "${folder}")
        list(APPEND kept "${folder}")
      endif()
    endforeach()
    set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${kept}")
  endforeach()
endfunction()

# The C++ of a type support goes to the compiler in a few large files: nearly half the time.
# The generated C cannot: its files share names of static variables.
function(join_cpp_sources)
  foreach(support IN ITEMS
      typesupport_c typesupport_cpp typesupport_fastrtps_c typesupport_fastrtps_cpp
      typesupport_introspection_cpp)
    set(target ${PROJECT_NAME}__rosidl_${support})
    if(TARGET ${target})
      set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 13)
    endif()
  endforeach()
endfunction()

cmake_language(DEFER CALL drop_missing_includes)
cmake_language(DEFER CALL join_cpp_sources)
