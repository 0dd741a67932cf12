/* Controller and plant of painleve. Generated from the crate painleve-c-abi; its test
   `the_header_matches_the_functions` fails when it is out of date. */

#ifndef PAINLEVE_H
#define PAINLEVE_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// Return value of a call.
typedef enum {
  // Success.
  PAINLEVE_STATUS_OK = 0,
  // A pointer is null or not aligned, a text is not UTF-8, or an answer is to another tick or unknown.
  PAINLEVE_STATUS_INVALID_ARGUMENT = 1,
  // The scenario is invalid.
  PAINLEVE_STATUS_INVALID_SCENARIO = 2,
  // The plant's motion cannot be continued.
  PAINLEVE_STATUS_PLANT_FAILED = 3,
  // A bug in this library; the object must only be freed.
  PAINLEVE_STATUS_PANIC = 4,
  // Sample and advance do not alternate; the plant is unchanged.
  PAINLEVE_STATUS_WRONG_ORDER = 5,
} PainleveStatus;

// A controller with its state.
typedef struct PainleveController PainleveController;

// A plant with its converters.
typedef struct PainlevePlant PainlevePlant;

// Sensor frame of one tick. docs/interface.md, *Layouts*, has the scale and the sign of each count.
typedef struct {
  // Tick; wraps at 2^32.
  uint32_t tick;
  // Number of the frame; wraps at 2^32.
  uint32_t sequence;
  // Encoders of the first joint and of the elbow, counts.
  uint32_t joints[2];
  // Normal force, counts.
  int32_t normal_force;
  // Tangential force, counts.
  int32_t tangential_force;
  // Digital inputs. Bit 0, ENABLE: a rising edge, or a high level in the first frame, arms the drive; low takes the torque
  // off. Bit 1, RESET: a rising edge clears a fault. Bits 2 to 5 are a board's: arming refused, stage not ready, gap
  // against force, winding hot. Leave the others 0.
  uint32_t inputs;
} PainleveSensorFrame;

// The controller's answer.
typedef struct {
  // Tick of the answered sensor frame.
  uint32_t tick;
  // Number of the answer; wraps at 2^32.
  uint32_t sequence;
  // Torques of both joints, counts.
  int32_t torques[2];
  // Reference of the tip along the belt, micrometres.
  int32_t reference_tip_um;
  // Estimated position of the tip along the belt, micrometres.
  int32_t estimated_tip_um;
  // State: 0 idle, 1 armed, 2 tracking, 3 lift-off, 4 fault. The torque stages are off in idle and fault.
  uint8_t state;
  // Number of the latched fault; 0 for none.
  uint8_t fault;
  // Flags. Bits: 0 contact, 1 torque saturated, 2 reference done, 4 reference held at the edge, 5 tip being returned to
  // the belt, 6 slip is negative, 7 tip sticks.
  uint16_t flags;
} PainleveActuatorFrame;

// The plant at one instant.
typedef struct {
  // Simulated time, s.
  double time_s;
  // Angles of the links from the belt's inward normal, rad.
  double theta_rad[2];
  // Their rates, rad/s.
  double theta_dot_rad_s[2];
  // Position of the tip along the belt, m.
  double tip_t_m;
  // Height of the tip above the belt, m.
  double gap_m;
  // Velocity of the tip relative to the belt, m/s.
  double slip_velocity_m_s;
  // Velocity of the belt, m/s.
  double belt_speed_m_s;
  // Normal force on the tip, N.
  double normal_force_n;
  // Tangential force on the tip, N.
  double tangential_force_n;
  // Torques that act on the joints, N m.
  double torque_nm[2];
  // Contact mode: 0 flight, 1 and 2 sliding forwards and backwards, 3 sticking.
  uint8_t contact_mode;
} PainleveSnapshot;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns the message of this thread's last failed call, in one sentence; empty if no call has
// failed. It is valid until this thread's next failed call: call this function in a statement of its
// own, because C evaluates the arguments of a call in any order.
const char *painleve_last_error(void);

// Creates the controller of a scenario.
//
// # Safety
// `scenario_toml` is a null-terminated string; `controller` can be written.
PainleveStatus painleve_controller_new(const char *scenario_toml, PainleveController **controller);

// Runs one tick: reads a sensor frame and writes the answer.
//
// # Safety
// `controller` comes from [`painleve_controller_new`] and has not been freed, `sensor` can be read
// and `actuator` written, and no other thread uses the controller at the same time.
PainleveStatus painleve_controller_tick(PainleveController *controller,
                                        const PainleveSensorFrame *sensor,
                                        PainleveActuatorFrame *actuator);

// Frees a controller; does nothing with null.
//
// # Safety
// `controller` is null or comes from [`painleve_controller_new`], and is not used again.
void painleve_controller_free(PainleveController *controller);

// Creates the plant of a scenario, at time 0.
//
// # Safety
// `scenario_toml` is a null-terminated string; `plant` can be written.
PainleveStatus painleve_plant_new(const char *scenario_toml, PainlevePlant **plant);

// Reads the sensors at this tick, once per tick and before [`painleve_plant_advance`]; another order is refused. Sets
// `is_lost` if the scenario loses this frame in transit; the controller must then not receive it.
//
// # Safety
// `plant` comes from [`painleve_plant_new`] and has not been freed, `sensor` and `is_lost` can be
// written, and no other thread uses the plant at the same time.
PainleveStatus painleve_plant_sample(PainlevePlant *plant,
                                     PainleveSensorFrame *sensor,
                                     bool *is_lost);

// Accepts the answer to this tick's sample, or null if there is none, and advances to the next
// tick. An answer to another tick, or with an unknown state or fault, is refused.
//
// # Safety
// `plant` comes from [`painleve_plant_new`] and has not been freed, `actuator` is null or can be
// read, and no other thread uses the plant at the same time.
PainleveStatus painleve_plant_advance(PainlevePlant *plant, const PainleveActuatorFrame *actuator);

// Writes the present state of the plant.
//
// # Safety
// `plant` comes from [`painleve_plant_new`] and has not been freed, `snapshot` can be written, and
// no other thread uses the plant at the same time.
PainleveStatus painleve_plant_snapshot(const PainlevePlant *plant, PainleveSnapshot *snapshot);

// Frees a plant; does nothing with null.
//
// # Safety
// `plant` is null or comes from [`painleve_plant_new`], and is not used again.
void painleve_plant_free(PainlevePlant *plant);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PAINLEVE_H */
