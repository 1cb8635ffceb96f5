// A recording's YAML, with a table of a run, of soil tests and of steady values beside it.
#include "harness.h"
#include "scenario/recording_file.h"

FUZZ(recording_yaml) {
  using namespace terrode;
  static const bool once = [] {
    const std::string run = "time [s],drawbar_pull [N],driving_torque [N m],sinkage [m],normal_load [N],angular_velocity [rad/s]\n"
                            "0,1,2,0.01,100,0.3\n0.1,1.5,2.1,0.011,101,0.3\n0.2,1.2,2.2,0.01,99,0.3\n";
    const std::string plate = "sinkage [m],pressure [Pa]\n0.001,1000\n0.01,9000\n0.02,15000\n";
    const std::string shear = "shear_displacement [m],shear_stress [Pa]\n0.001,100\n0.01,900\n0.02,1000\n";
    const std::string table = "id,slip,normal_load [N],drawbar_pull [N]\na,0.1,100,5\nb,0.2,100,9\n";
    const auto put = [](const char* name, const std::string& text) {
      fuzz::as_file(name, reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    };
    put("a.csv", run), put("p.csv", plate), put("s.csv", shear), put("t.csv", table);
    return true;
  }();
  (void)once;
  (void)scenario::check_recording(fuzz::as_file("recording.yaml", data, size), 1);
}
