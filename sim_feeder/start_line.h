// Where the vehicles of a fleet wait for each other, so that all begin to send
// together and none has a head start over who still makes messages or connects.

#ifndef FATHOM_SIM_FEEDER_START_LINE_H_
#define FATHOM_SIM_FEEDER_START_LINE_H_

#include <latch>

namespace fathom::feeder {

// One vehicle's place at the line. Of one thread. Who fails before it is there
// holds up nobody: the place counts as taken when it is destroyed.
class StartPlace {
 public:
  // `line` expects one arrival of each vehicle; it must outlive this.
  explicit StartPlace(std::latch& line) : line_(line) {}
  ~StartPlace() {
    if (!arrived_) line_.count_down();
  }
  StartPlace(const StartPlace&) = delete;
  StartPlace& operator=(const StartPlace&) = delete;

  // Returns when all are there, or have failed. At most once.
  void WaitForAll() {
    arrived_ = true;
    line_.arrive_and_wait();
  }

 private:
  std::latch& line_;
  bool arrived_ = false;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_START_LINE_H_
