# cmake -D SOURCE=.. -D BINARY=.. -D GENERATOR=.. -D COMPILER=.. -D LAUNCHER=.. -P test.cmake: what somebody does who
# embeds the caches. Configures the library alone, builds and installs it, builds a renderer against what was installed,
# runs it. And does so from and to unusual places, and as a folder of another project.
set(options -G ${GENERATOR} -D CMAKE_CXX_COMPILER=${COMPILER} "-DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER}")
set(release -D CMAKE_BUILD_TYPE=Release)
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE ${BINARY}/installed)
run(${CMAKE_COMMAND} -S ${SOURCE} -B ${BINARY}/library ${options} ${release} -D ICBENCH_LIBRARY_ONLY=ON
    -D CMAKE_INSTALL_PREFIX=${BINARY}/installed)
run(${CMAKE_COMMAND} --build ${BINARY}/library)
run(${CMAKE_COMMAND} --install ${BINARY}/library)
run(${CMAKE_COMMAND} -S ${SOURCE}/tests/embedding -B ${BINARY}/renderer ${options} ${release}
    -D CMAKE_PREFIX_PATH=${BINARY}/installed)
run(${CMAKE_COMMAND} --build ${BINARY}/renderer)
run(${BINARY}/renderer/renderer ${BINARY}/room.cache)

# From a folder whose name a shell takes for two words, installed as links: what they lead to stays as it was.
file(REMOVE_RECURSE "${BINARY}/a copy-1")
file(COPY ${SOURCE}/CMakeLists.txt ${SOURCE}/src DESTINATION "${BINARY}/a copy-1")
run(${CMAKE_COMMAND} -S "${BINARY}/a copy-1" -B "${BINARY}/a copy-1/build" ${options} ${release}
    -D ICBENCH_LIBRARY_ONLY=ON -D CMAKE_INSTALL_PREFIX=${BINARY}/links)
run(${CMAKE_COMMAND} --build "${BINARY}/a copy-1/build")
file(REMOVE_RECURSE ${BINARY}/links)
run(${CMAKE_COMMAND} -E env CMAKE_INSTALL_MODE=ABS_SYMLINK ${CMAKE_COMMAND} --install "${BINARY}/a copy-1/build")
run(${CMAKE_COMMAND} -E compare_files ${SOURCE}/src/caches/direct.h "${BINARY}/a copy-1/src/caches/direct.h")
file(READ ${BINARY}/links/include/icbench/caches/direct.h text)
if(NOT text MATCHES "#include \"../caches/session.h\"")
  message(FATAL_ERROR "installed headers look for each other in other folders")
endif()

# Around it is a project with warnings, a machine and a kind of build of its own, and variables of any name.
file(WRITE ${BINARY}/around/around.cpp "#include \"caches/direct.h\"
#include \"caches/packed_octree.h\"
int main() { return icbench::Direct<icbench::Packed<icbench::StdSync>>({}).open_session(0).query({}).has_value(); }
")
file(WRITE ${BINARY}/around/CMakeLists.txt "cmake_minimum_required(VERSION 3.22)
project(around LANGUAGES CXX)
option(CCACHE \"Somebody's own\" ON)
set(ICBENCH_LIBRARY_ONLY ON)
add_subdirectory(${SOURCE} icbench)
add_executable(around around.cpp)
target_link_libraries(around PRIVATE icbench::caches)
get_target_property(flags icbench_flags INTERFACE_COMPILE_OPTIONS)
if(flags MATCHES \"-W|-march\" OR CMAKE_BUILD_TYPE)
  message(FATAL_ERROR \"what is linked to a cache gets \${flags}, and all of the project \${CMAKE_BUILD_TYPE}\")
endif()
")
file(REMOVE_RECURSE ${BINARY}/around/build)
run(${CMAKE_COMMAND} -S ${BINARY}/around -B ${BINARY}/around/build ${options})
run(${CMAKE_COMMAND} --build ${BINARY}/around/build)
run(${BINARY}/around/build/around)
