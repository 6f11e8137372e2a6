# cmake -D SOURCE=.. -D BINARY=.. -D GENERATOR=.. -D COMPILER=.. -D LAUNCHER=.. -P test.cmake: what somebody does who
# embeds the caches. Configures the library alone, builds and installs it, builds a renderer against what was installed,
# runs it. And builds the library as a folder of another project.
set(options -G ${GENERATOR} -D CMAKE_CXX_COMPILER=${COMPILER} "-DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER}"
            -D CMAKE_BUILD_TYPE=Release)
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE ${BINARY}/installed)
run(${CMAKE_COMMAND} -S ${SOURCE} -B ${BINARY}/library ${options} -D ICBENCH_LIBRARY_ONLY=ON
    -D CMAKE_INSTALL_PREFIX=${BINARY}/installed)
run(${CMAKE_COMMAND} --build ${BINARY}/library)
run(${CMAKE_COMMAND} --install ${BINARY}/library)
run(${CMAKE_COMMAND} -S ${SOURCE}/tests/embedding -B ${BINARY}/renderer ${options}
    -D CMAKE_PREFIX_PATH=${BINARY}/installed)
run(${CMAKE_COMMAND} --build ${BINARY}/renderer)
run(${BINARY}/renderer/renderer ${BINARY}/room.cache)

file(WRITE ${BINARY}/around/CMakeLists.txt "cmake_minimum_required(VERSION 3.22)
project(around LANGUAGES CXX)
set(ICBENCH_LIBRARY_ONLY ON)
add_subdirectory(${SOURCE} icbench)
")
run(${CMAKE_COMMAND} -S ${BINARY}/around -B ${BINARY}/around/build ${options})
run(${CMAKE_COMMAND} --build ${BINARY}/around/build)
