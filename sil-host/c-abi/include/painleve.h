/* Controller and plant of painleve. Generated from the crate painleve-c-abi; its test
   `the_header_is_that_of_the_functions` says when it is out of date. */

#ifndef PAINLEVE_H
#define PAINLEVE_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// What a call returns.
typedef enum {
  // Done.
  PAINLEVE_STATUS_OK = 0,
  // A pointer is null, or a text is not UTF-8.
  PAINLEVE_STATUS_INVALID_ARGUMENT = 1,
  // The scenario is wrong.
  PAINLEVE_STATUS_INVALID_SCENARIO = 2,
  // The plant's motion cannot be continued.
  PAINLEVE_STATUS_PLANT_FAILED = 3,
  // A defect of this library; the object must only be freed.
  PAINLEVE_STATUS_PANIC = 4,
} PainleveStatus;

// A controller with its state.
typedef struct PainleveController PainleveController;

// A plant with its converters.
typedef struct PainlevePlant PainlevePlant;

// What the controller is told at a tick.
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
  // Digital inputs; bit 0 enables the drive.
  uint32_t inputs;
} PainleveSensorFrame;

// What the controller answers.
typedef struct {
  // Tick of the sensor frame that is answered.
  uint32_t tick;
  // Number of the sensor frame that is answered.
  uint32_t sequence;
  // Torques of both joints, counts.
  int32_t torques[2];
  // Reference of the tip along the belt, micrometres.
  int32_t reference_tip_um;
  // Estimated position of the tip along the belt, micrometres.
  int32_t estimated_tip_um;
  // Number of the supervisor's state.
  uint8_t state;
  // Number of the latched fault; 0 for none.
  uint8_t fault;
  // Status flags.
  uint16_t flags;
} PainleveActuatorFrame;

// The plant at an instant.
typedef struct {
  // Simulated time, s.
  double time_s;
  // Angles from the downward vertical, rad.
  double theta_rad[2];
  // Their rates, rad/s.
  double theta_dot_rad_s[2];
  // Position of the tip along the belt, m.
  double tip_t_m;
  // Height of the tip over the belt, m.
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
  // What holds the tip: 0 nothing, 1 and 2 it slides forwards and backwards, 3 it sticks.
  uint8_t contact_mode;
} PainleveSnapshot;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The message of the last call of this thread that failed, in one sentence; empty if none has.
// Valid until the next call of this thread that fails.
const char *painleve_last_error(void);

// Makes the controller of a scenario.
//
// # Safety
// `scenario_toml` is a string that ends with a zero byte; `controller` can be written.
PainleveStatus painleve_controller_new(const char *scenario_toml, PainleveController **controller);

// Runs one tick: takes a sensor frame, and writes the answer.
//
// # Safety
// `controller` is from [`painleve_controller_new`] and not freed, `sensor` can be read and
// `actuator` written, and no other thread uses the controller meanwhile.
PainleveStatus painleve_controller_tick(PainleveController *controller,
                                        const PainleveSensorFrame *sensor,
                                        PainleveActuatorFrame *actuator);

// Frees a controller; does nothing with null.
//
// # Safety
// `controller` is null or from [`painleve_controller_new`], and is not used again.
void painleve_controller_free(PainleveController *controller);

// Makes the plant of a scenario, at time 0.
//
// # Safety
// `scenario_toml` is a string that ends with a zero byte; `plant` can be written.
PainleveStatus painleve_plant_new(const char *scenario_toml, PainlevePlant **plant);

// Reads the sensors at this tick; to be called once per tick, before
// [`painleve_plant_advance`]. `is_lost` says whether the scenario loses this frame on its way:
// the controller must not be given it then.
//
// # Safety
// `plant` is from [`painleve_plant_new`] and not freed, `sensor` and `is_lost` can be written,
// and no other thread uses the plant meanwhile.
PainleveStatus painleve_plant_sample(PainlevePlant *plant,
                                     PainleveSensorFrame *sensor,
                                     bool *is_lost);

// Takes the answer to this tick's sample, null if there is none, and goes on to the next tick.
//
// # Safety
// `plant` is from [`painleve_plant_new`] and not freed, `actuator` is null or can be read, and no
// other thread uses the plant meanwhile.
PainleveStatus painleve_plant_advance(PainlevePlant *plant, const PainleveActuatorFrame *actuator);

// Writes everything about the present.
//
// # Safety
// `plant` is from [`painleve_plant_new`] and not freed, `snapshot` can be written, and no other
// thread uses the plant meanwhile.
PainleveStatus painleve_plant_snapshot(const PainlevePlant *plant, PainleveSnapshot *snapshot);

// Frees a plant; does nothing with null.
//
// # Safety
// `plant` is null or from [`painleve_plant_new`], and is not used again.
void painleve_plant_free(PainlevePlant *plant);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PAINLEVE_H */
