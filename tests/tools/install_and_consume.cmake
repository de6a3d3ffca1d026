# Installs the build tree into a fresh prefix, then configures, builds and runs a small program that
# knows nothing but find_package(sinew). cmake -DBUILD=... -DSOURCE=... -DWORK=... -P this
function(step)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "${ARGV}\nended with ${code}:\n${output}")
  endif()
endfunction()

file(REMOVE_RECURSE ${WORK})
step(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix)
step(${CMAKE_COMMAND} -S ${SOURCE}/tests/tools/consumer -B ${WORK}/build -DCMAKE_BUILD_TYPE=Release
     -DCMAKE_PREFIX_PATH=${WORK}/prefix)
step(${CMAKE_COMMAND} --build ${WORK}/build)
step(${WORK}/build/consumer ${SOURCE}/samples/ogre/ogre.obj ${SOURCE}/samples/ogre/ogre.toml
     ${SOURCE}/samples/ogre/walk.bvh ${WORK}/walk.glb)
step(${WORK}/prefix/bin/sinew --version)
if(NOT EXISTS ${WORK}/walk.glb)
  message(FATAL_ERROR "the consumer wrote no file")
endif()
