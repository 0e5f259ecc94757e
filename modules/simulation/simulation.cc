#include "simulation/simulation.h"

#include <charconv>
#include <cmath>
#include <map>
#include <utility>

#include "core/errors.h"
#include "simulation/country.h"
#include "simulation/depth_sensor.h"
#include "simulation/highway.h"
#include "simulation/survey.h"

namespace tessera {
namespace {

using Scene = SimulationOptions::Scene;

const Eigen::Vector3d kRoomM(6.4, 2.7, 5.2);
constexpr CarMotion kCountryDrive{.cruise_mps = 17.0, .side_acceleration_mps2 = 3.5, .drives_on = true};
constexpr CarMotion kHighwayDrive{.cruise_mps = 28.0, .side_acceleration_mps2 = 3.5, .drives_on = true};

// What is mounted, and how often it takes a picture.
struct CameraModel {
  double width_px, height_px, focal_px, baseline_m, exposure_s, frames_per_s, readout_s;
  int max_blur_taps = 9;
  double max_exposure = 1.0;
};
constexpr CameraModel kCarCamera{1241.0, 376.0, 718.0, 0.54, 0.004, 10.0, 0.0};
constexpr CameraModel kHandCamera{640.0, 480.0, 525.0, 0.12, 0.008, 30.0, 0.0};
constexpr CameraModel kKinect{640.0, 480.0, 525.0, 0.12, 0.016, 30.0, 0.025, 25};
constexpr CameraModel kDroneCamera{752.0, 480.0, 458.0, 0.11, 0.003, 20.0, 0.0, 25, 4.0};
constexpr CameraModel kWalkCamera{640.0, 480.0, 525.0, 0.12, 0.008, 2.0, 0.0};

const CameraModel& ModelOf(Scene scene) {
  switch (scene) {
    case Scene::kRoom:
    case Scene::kRobot:
      return kHandCamera;
    case Scene::kWalk:
      return kWalkCamera;
    case Scene::kDesk:
    case Scene::kOffice:
      return kKinect;
    case Scene::kFlight:
    case Scene::kSurvey:
      return kDroneCamera;
    default:
      return kCarCamera;
  }
}

// How far ahead of the camera stands what carries it, m.
double ReachOf(Scene scene) { return &ModelOf(scene) == &kCarCamera ? 2.2 : 0.5; }

CameraCalibration MakeCamera(const SimulationOptions& options, SensorType sensor) {
  const CameraModel& model = ModelOf(options.scene);
  const double s = options.scale;
  CameraCalibration camera;
  camera.sensor = sensor;
  camera.width_px = static_cast<int>(std::lround(s * model.width_px));
  camera.height_px = static_cast<int>(std::lround(s * model.height_px));
  camera.fx_px = camera.fy_px = s * model.focal_px;
  // Where a point of the image lies when pixels shrink: (c + 1/2) s - 1/2.
  camera.cx_px = s * 0.5 * model.width_px - 0.5;
  camera.cy_px = s * 0.5 * model.height_px - 0.5;
  camera.baseline_m = sensor == SensorType::kStereo ? model.baseline_m : 0.0;
  camera.depth_unit_m = sensor == SensorType::kRgbd ? 0.001 : 0.0;
  return camera;
}

CameraEffects MakeEffects(const SimulationOptions& options) {
  CameraEffects effects;
  effects.exposure_s = ModelOf(options.scene).exposure_s;
  effects.max_blur_taps = ModelOf(options.scene).max_blur_taps;
  effects.max_exposure = ModelOf(options.scene).max_exposure;
  effects.read_noise *= options.noise;
  effects.shot_noise *= options.noise * options.noise;
  effects.depth_noise *= options.noise;
  return effects;
}

StreetPlan MakePlan(const SimulationOptions& options) {
  if (!options.path.empty()) return PlanFromPoses(options.path, options.length_m);
  return options.scene == Scene::kStreet ? PlanTown(options.seed, options.length_m)
                                         : PlanRound(options.seed, options.length_m);
}

double ParseNumber(const std::string& key, const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw InputError("sim: " + key + "=" + text + " is not a number");
  }
  return value;
}

void SetOption(const std::string& key, const std::string& value, SimulationOptions& options) {
  if (key == "path") {
    options.path = value;
    return;
  }
  const double number = ParseNumber(key, value);
  const std::map<std::string, double*> numbers{{"length", &options.length_m},
                                               {"duration", &options.duration_s},
                                               {"speed", &options.speed},
                                               {"noise", &options.noise},
                                               {"scale", &options.scale},
                                               {"readout", &options.readout_ms},
                                               {"depth_delay", &options.depth_delay_ms},
                                               {"right_delay", &options.right_delay_ms},
                                               {"stop", &options.stop_m},
                                               {"body", &options.body},
                                               {"people", &options.people},
                                               {"bumps", &options.bumps},
                                               {"squint", &options.squint},
                                               {"twist", &options.twist},
                                               {"pitch", &options.pitch},
                                               {"stamp", &options.stamp}};
  if (const auto found = numbers.find(key); found != numbers.end()) {
    *found->second = number;
  } else if (key == "seed" && number >= 0.0 && number < 4294967296.0) {
    options.seed = static_cast<uint32_t>(number);
  } else {
    throw InputError(
        "sim: `" + key + "=" + value +
        "` is unknown or out of range: give seed, length (m), duration (s), readout (ms), "
        "depth_delay (ms), right_delay (ms), stop (m), people, bumps, squint, twist, pitch, body, stamp, speed, "
        "noise, scale or path");
  }
}

}  // namespace

Result<> SimulationOptions::Check() const {
  if (!(length_m >= 0.0 && length_m < 1e5)) return Failed("sim: length must be between 0 and 100000 m");
  if (!(duration_s >= 0.0 && duration_s < 1e5)) return Failed("sim: duration must be between 0 and 100000 s");
  if (!(speed >= 0.05 && speed <= 10.0)) return Failed("sim: speed must be between 0.05 and 10 times the usual");
  if (!(noise >= 0.0 && noise <= 20.0)) return Failed("sim: noise must be between 0 and 20 times the usual");
  if (!(scale >= 0.1 && scale <= 4.0)) return Failed("sim: scale must be between 0.1 and 4 times the usual");
  if (!(readout_ms == -1.0 || (readout_ms >= 0.0 && readout_ms <= 100.0))) {
    return Failed("sim: readout must be between 0 and 100 ms");
  }
  if (!(depth_delay_ms >= -100.0 && depth_delay_ms <= 100.0)) {
    return Failed("sim: depth_delay must be between -100 and 100 ms");
  }
  if (!(right_delay_ms >= -100.0 && right_delay_ms <= 100.0)) {
    return Failed("sim: right_delay must be between -100 and 100 ms");
  }
  if (!(body >= 0.0 && body <= 0.5)) return Failed("sim: body must be between 0 and 0.5 of the image's height");
  if (!(people >= 0.0 && people <= 8.0)) return Failed("sim: people must be between 0 and 8");
  if (!(std::abs(squint) <= 2.0 && std::abs(twist) <= 2.0 && std::abs(pitch) <= 2.0)) {
    return Failed("sim: squint, twist and pitch must be between -2 and 2 degrees");
  }
  if (!(bumps >= 0.0 && bumps <= 1.0)) return Failed("sim: bumps must be between 0 and 1");
  if (!(stamp == 0.0 || stamp == 1.0)) return Failed("sim: stamp must be 0 or 1");
  if (!(stop_m >= 7.0 && stop_m <= 20.0)) return Failed("sim: stop must be between 7 and 20 m");
  return {};
}

SimulationOptions ParseSimulation(const std::string& text) {
  SimulationOptions options;
  const std::string name = text.substr(0, text.find(','));
  const std::map<std::string, Scene> scenes{{"street", Scene::kStreet},   {"street-short", Scene::kStreetShort},
                                            {"traffic", Scene::kTraffic}, {"highway", Scene::kHighway},
                                            {"room", Scene::kRoom},       {"country", Scene::kCountry},
                                            {"walk", Scene::kWalk},       {"desk", Scene::kDesk},
                                            {"office", Scene::kOffice},   {"robot", Scene::kRobot},
                                            {"flight", Scene::kFlight},   {"survey", Scene::kSurvey}};
  const auto scene = scenes.find(name);
  if (scene == scenes.end()) {
    throw InputError("sim:" + name +
                     " is unknown: give sim:street, sim:street-short, sim:traffic, sim:highway, sim:room, sim:country, "
                     "sim:walk, sim:desk, sim:office, sim:robot, sim:flight or sim:survey");
  }
  options.scene = scene->second;
  for (size_t begin = name.size(); begin < text.size();) {
    const size_t end = std::min(text.find(',', begin + 1), text.size());
    const std::string option = text.substr(begin + 1, end - begin - 1);
    const size_t equals = option.find('=');
    if (equals == std::string::npos) throw InputError("sim: `" + option + "` must be KEY=VALUE, such as seed=3");
    SetOption(option.substr(0, equals), option.substr(equals + 1), options);
    begin = end;
  }
  ThrowIfFailed<InputError>(options.Check());
  return options;
}

Simulation::Simulation(const SimulationOptions& options, SensorType sensor)
    : options_(options), camera_(MakeCamera(options, sensor)) {
  ThrowIfFailed<InputError>(options.Check());
  frames_per_s_ = ModelOf(options.scene).frames_per_s;
  readout_s_ = options.readout_ms < 0.0 ? ModelOf(options.scene).readout_s : 0.001 * options.readout_ms;
  const double free_s = options.scene == Scene::kFlight ? 60.0 : 20.0;
  const double duration_s = options.duration_s > 0.0 ? options.duration_s : free_s;
  World world;
  switch (options.scene) {
    case Scene::kStreet:
    case Scene::kStreetShort: {
      const StreetPlan plan = MakePlan(options);
      trajectory_ = std::make_unique<CarTrajectory>(plan.drive, options.speed, options.seed);
      world = BuildStreets(plan, options.seed);
      break;
    }
    case Scene::kTraffic: {
      const StreetPlan plan = PlanTraffic(options.seed, options.length_m, options.stop_m);
      CarMotion motion;
      for (const Stop& stop : plan.stops) motion.waits.push_back({stop.at_m, stop.wait_s});
      const auto drive = std::make_shared<const CarTrajectory>(plan.drive, options.speed, options.seed, motion);
      world = BuildStreets(plan, options.seed);
      AddTraffic(plan, drive, options.seed, world);
      trajectory_ = drive;
      break;
    }
    case Scene::kRoom:
      trajectory_ = std::make_unique<HandTrajectory>(kRoomM, duration_s, options.speed, options.seed);
      world = BuildRoom(kRoomM, options.seed);
      break;
    case Scene::kRobot:
      trajectory_ = std::make_unique<RobotTrajectory>(kRoomM, options.speed, options.seed);
      world = BuildRoom(kRoomM, options.seed);
      break;
    case Scene::kCountry: {
      const CountryPlan plan = PlanCountry(options.seed, options.length_m);
      const auto terrain = std::make_shared<const Terrain>(plan.road, options.seed);
      trajectory_ = std::make_unique<CarTrajectory>(plan.drive, options.speed, options.seed, kCountryDrive, terrain);
      world = BuildCountry(plan, *terrain, options.seed);
      break;
    }
    case Scene::kHighway: {
      const HighwayPlan plan = PlanHighway(options.seed, options.length_m);
      const auto drive = std::make_shared<const CarTrajectory>(plan.drive, options.speed, options.seed, kHighwayDrive);
      world = BuildHighway(plan, options.seed);
      AddHighwayTraffic(plan, drive, options.seed, world);
      trajectory_ = drive;
      break;
    }
    case Scene::kDesk:
      trajectory_ = std::make_unique<DeskTrajectory>(duration_s, options.speed, options.seed);
      world = BuildDesk(options.seed);
      break;
    case Scene::kOffice:
      trajectory_ = std::make_unique<OfficeTrajectory>(duration_s, options.speed, options.seed);
      world = BuildDesk(options.seed, 4.4, 3.2);
      AddPeople(static_cast<int>(options.people), duration_s, options.seed, world);
      break;
    case Scene::kFlight:
      trajectory_ = std::make_unique<FlightTrajectory>(duration_s, options.speed, options.seed, options.bumps);
      world = BuildHall(options.seed);
      break;
    case Scene::kSurvey:
      trajectory_ = std::make_unique<SurveyTrajectory>(options.speed, options.seed);
      world = BuildFields(options.seed);
      break;
    case Scene::kWalk: {
      const StreetPlan plan = PlanStroll(options.seed, options.length_m);
      trajectory_ = std::make_unique<WalkTrajectory>(plan.drive, options.speed, options.seed);
      world = BuildStreets(plan, options.seed);
      break;
    }
  }
  if (options.body > 0.0) AddBody(camera_, options.body, ReachOf(options.scene), options.seed, world);
  renderer_ = std::make_unique<Renderer>(std::make_shared<const World>(std::move(world)));
  num_frames_ = static_cast<int64_t>(trajectory_->duration_s() * frames_per_s_);
  effects_ = std::make_unique<EffectsPipeline>(camera_, MakeEffects(options), options.seed);
}

Simulation::~Simulation() = default;

double Simulation::TimeOf(FrameId frame) const { return static_cast<double>(frame.value) / frames_per_s_; }
int64_t Simulation::UtimeOf(FrameId frame) const { return std::llround(1e6 * TimeOf(frame)); }
Rigid3 Simulation::WorldFromCamera(FrameId frame) const { return trajectory_->WorldFromCamera(TimeOf(frame)); }

CameraVelocity Simulation::VelocityAt(double time_s) const {
  constexpr double kStepS = 0.002;
  const double duration = trajectory_->duration_s();
  const Rigid3 before = trajectory_->WorldFromCamera(std::max(0.0, time_s - kStepS));
  const Rigid3 after = trajectory_->WorldFromCamera(std::min(duration, time_s + kStepS));
  const Rigid3 step = before.Inverse() * after;
  // The vector part of a small rotation's quaternion is half its angle.
  return {step.translation / (2.0 * kStepS), 2.0 * step.rotation.vec() / (2.0 * kStepS)};
}

Rigid3 Simulation::WorldFromCameraAt(double time_s, double row) const {
  const double part = (row + 0.5) / camera_.height_px - 0.5;
  return trajectory_->WorldFromCamera(time_s + part * readout_s_);
}

Rigid3 Simulation::WorldFromCameraAtRow(FrameId frame, double row) const {
  return WorldFromCameraAt(TimeOf(frame), row);
}

void Simulation::RenderEye(double time_s, double right_m, Rendering& out) {
  Rigid3 left_from_eye{Eigen::Quaterniond::Identity(), {right_m, 0.0, 0.0}};
  // Half of such small angles is the vector part of a quaternion.
  constexpr double kHalfDegree = 0.00872664626;
  if (right_m > 0.0) {
    const Eigen::Vector3d turn = kHalfDegree * Eigen::Vector3d(options_.pitch, -options_.squint, options_.twist);
    const Eigen::Quaterniond turned(1.0, turn.x(), turn.y(), turn.z());
    left_from_eye.rotation = turned.normalized();
  }
  if (readout_s_ == 0.0) {
    renderer_->Render(camera_, trajectory_->WorldFromCamera(time_s) * left_from_eye, time_s, out, left_from_eye);
    return;
  }
  const auto world_from_eye = [&](double row) { return WorldFromCameraAt(time_s, row) * left_from_eye; };
  renderer_->RenderRolling(camera_, world_from_eye, time_s, out, left_from_eye);
}

void Simulation::RenderPerfect(FrameId frame, Rendering& out) { RenderEye(TimeOf(frame), 0.0, out); }

CameraFrame Simulation::Render(FrameId id) {
  const double time = TimeOf(id);
  const CameraVelocity velocity = VelocityAt(time);
  const auto picture = static_cast<uint32_t>(2 * id.value);
  CameraFrame frame;
  frame.id = id;
  frame.utime_us = UtimeOf(id);
  frame.sensor = camera_.sensor;
  RenderEye(time, 0.0, rendering_);
  frame.left = effects_->Apply(rendering_, velocity, time, picture);
  if (options_.stamp > 0.0) StampTime(time, frame.left);
  if (camera_.sensor == SensorType::kRgbd) {
    if (options_.depth_delay_ms != 0.0) {
      RenderEye(time + 0.001 * options_.depth_delay_ms, 0.0, rendering_);
    }
    if (options_.scene == Scene::kDesk || options_.scene == Scene::kOffice) {
      DepthSensor sensor;
      sensor.disparity_noise_px *= options_.noise;
      frame.depth = MeasureDepth(rendering_, camera_, sensor, options_.seed, picture);
    } else {
      frame.depth = effects_->Depth(rendering_, picture);
    }
  } else if (camera_.sensor == SensorType::kStereo) {
    const double right_time = time + 0.001 * options_.right_delay_ms;
    RenderEye(right_time, camera_.baseline_m, rendering_);
    frame.right = effects_->Apply(rendering_, VelocityAt(right_time), right_time, picture + 1);
    if (options_.stamp > 0.0) StampTime(time, frame.right);
  }
  return frame;
}

}  // namespace tessera
