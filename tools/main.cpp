#include <exception>
#include <iostream>
#include <new>

#include "io/file_error.h"
#include "skeleton/unusable_input.h"
#include "tools/interrupt.h"
#include "tools/options.h"

namespace {

/// One line for people, whatever went wrong; the code for programs.
sinew::ExitCode tell(const std::exception_ptr& problem) {
  using sinew::ExitCode;
  try {
    std::rethrow_exception(problem);
  } catch (const sinew::FileError& error) {
    std::cerr << "error: " << error.what() << '\n';
    return static_cast<ExitCode>(error.fault());
  } catch (const sinew::UnusableInput& error) {
    std::cerr << "error: " << error.what() << '\n';
    return ExitCode::unusable_input;
  } catch (const std::bad_alloc&) {
    std::cerr << "error: out of memory; a smaller --density needs less\n";
    return ExitCode::resource_limit;
  } catch (const std::exception& error) {
    std::cerr << "error: internal: " << error.what() << '\n';
    return ExitCode::internal;
  }
}

}  // namespace

int main(int argc, char** argv) {
  sinew::watch_for_interrupts();
  sinew::ExitCode code = sinew::ExitCode::internal;
  try {
    code = sinew::run_command_line(argc, argv);
  } catch (...) {
    code = tell(std::current_exception());
  }
  return static_cast<int>(code);
}
