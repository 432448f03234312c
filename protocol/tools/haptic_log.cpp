// SPDX-License-Identifier: MIT
// haptic_log: records what both daemons publish, tells what a recording holds, and writes its ticks as
// CSV. An observer: it maps both segments read-only and disturbs nobody.
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <iostream>
#include <map>
#include <thread>

#include "common/clock.h"
#include "common/command_line.h"
#include "common/daemon.h"
#include "common/exit_code.h"
#include "protocol/attach.h"
#include "protocol/impulse_units.h"
#include "protocol/tools/recording.h"
#include "protocol/words.h"

namespace rikiseki::protocol {
namespace {

namespace po = boost::program_options;

constexpr std::int64_t kPollNs = 10'000'000;     // the shortest ring lasts a hundred times longer
constexpr std::int64_t kAttachNs = 200'000'000;  // between two attempts
constexpr std::int64_t kFlushNs = 500'000'000;   // a crash loses no more than this
constexpr std::uint64_t kStateEveryNs = 100'000'000;  // health is a state: ten a second will do

struct Options {
  std::string verb;
  std::string file;
  std::string instance = "0";
  std::string out;
  double seconds = 0;  // 0 = until a signal
};

Options Parse(int argc, char** argv) {
  Options options;
  std::vector<std::string> words;
  CommandLine line{.program = "haptic_log",
                   .visible = po::options_description(
                       "haptic_log record FILE | info FILE | export FILE\n"
                       "records what both daemons publish; tells what a recording holds; writes "
                       "its ticks as CSV")};
  line.visible.add_options()("instance", po::value(&options.instance)->value_name("NAME"),
                             "record: which pair of daemons (default 0)")(
      "seconds", po::value(&options.seconds)->value_name("S"),
      "record: so long; default: until a signal")("out", po::value(&options.out)->value_name("CSV"),
                                                  "export: where to; default: stdout");
  line.hidden.add_options()("words", po::value(&words), "");
  line.positional.add("words", -1);
  ParseCommandLine(argc, argv, line);
  const std::vector<std::string> verbs{"record", "info", "export"};
  if (words.size() != 2 || std::find(verbs.begin(), verbs.end(), words[0]) == verbs.end()) {
    throw StartError(kExitUsage, "say record FILE, info FILE or export FILE; try --help");
  }
  if (!(options.seconds >= 0 && options.seconds <= 1e7)) {
    throw StartError(kExitUsage, "--seconds must be from 0 to 1e7");
  }
  options.verb = words[0];
  options.file = words[1];
  return options;
}

// One side's segment and its rings, followed over restarts.
class Side {
 public:
  Side(const std::string& instance, Role role) {
    request_.instance = instance;
    request_.role = role;
    SegmentName(instance, role);  // refuses a wrong name now
  }

  std::uint64_t lost() const {
    std::uint64_t lost = lost_before_;
    for (const Stream& stream : streams_) lost += stream.reader.lost() - stream.lost_at_first;
    return lost;
  }

  void Record(std::int64_t now_ns, RecordingWriter& writer) {
    Drain(writer);
    if (now_ns - attached_ns_ < kAttachNs) return;
    attached_ns_ = now_ns;
    if (view_ != nullptr && view_->OwnerAlive() && view_->IsCurrent()) return;
    // What a dead one published between the two looks.
    Drain(writer);
    lost_before_ = lost();
    streams_.clear();
    view_ = Attach(request_).view;
    if (view_ == nullptr) return;
    for (const StreamType type :
         {StreamType::kHapticTick, StreamType::kHapticHealth, StreamType::kWorldFrame,
          StreamType::kWorldHealth, StreamType::kWorldBodies, StreamType::kWorldScene}) {
      if (view_->Has(type)) streams_.push_back({.type = type, .reader = view_->Stream(type)});
    }
    std::cerr << "haptic_log: " << RoleName(request_.role) << " epoch " << view_->epoch() << "\n";
  }

 private:
  struct Stream {
    StreamType type;
    StreamReader reader;
    std::uint64_t kept_ns = 0;        // stamp of the newest that was kept
    std::uint64_t lost_at_first = 0;  // what was overwritten before anybody recorded
    bool begun = false;
    bool IsState() const {
      return type == StreamType::kHapticHealth || type == StreamType::kWorldHealth;
    }
  };

  void Drain(RecordingWriter& writer) {
    for (Stream& stream : streams_) {
      words_.resize(stream.reader.payload_bytes() / 8);
      Received received;
      while (stream.reader.ReadNext(words_, received) == ReadStatus::kFresh) {
        if (!stream.begun) stream.lost_at_first = stream.reader.lost();
        stream.begun = true;
        if (received.used_bytes / 8 > words_.size()) continue;  // nonsense
        if (stream.IsState() && received.stamp_ns < stream.kept_ns + kStateEveryNs) continue;
        stream.kept_ns = received.stamp_ns;
        writer.Add({.type = stream.type,
                    .epoch = view_->epoch(),
                    .received = received,
                    .words = std::span(words_).first(received.used_bytes / 8)});
      }
    }
  }

  AttachRequest request_;
  std::unique_ptr<PeerView> view_;
  std::vector<Stream> streams_;
  std::vector<std::uint64_t> words_;
  std::uint64_t lost_before_ = 0;
  std::int64_t attached_ns_ = 0;
};

int RecordPair(const Options& options) {
  BlockSignals();
  Side haptic(options.instance, Role::kHaptic);
  Side world(options.instance, Role::kWorld);
  RecordingWriter writer(options.file);
  const std::int64_t start_ns = MonotonicNow();
  std::int64_t flushed_ns = start_ns;
  while (true) {
    const std::int64_t now_ns = MonotonicNow();
    world.Record(now_ns, writer);
    haptic.Record(now_ns, writer);
    const bool over = options.seconds > 0 && Seconds(now_ns - start_ns) >= options.seconds;
    if (over || now_ns - flushed_ns >= kFlushNs) {
      flushed_ns = now_ns;
      writer.Flush(true);
    }
    if (over) break;
    const int signal = WaitForSignal(static_cast<int>(kPollNs / 1'000'000));
    if (signal == SIGINT || signal == SIGTERM) break;
  }
  writer.Flush(true);
  std::cerr << "haptic_log: " << writer.bytes() << " bytes; " << haptic.lost() + world.lost()
            << " messages came faster than they were read\n";
  return kExitOk;
}

std::int64_t MissedBefore(const HapticTick& tick) {
  if (tick.period_ns == 0) return 0;
  const double periods =
      static_cast<double>(tick.previous_duration_ns) / static_cast<double>(tick.period_ns);
  return std::max<std::int64_t>(0, std::llround(periods) - 1);
}

int PrintInfo(const Options& options) {
  struct Epoch {
    std::uint64_t messages = 0;
    std::uint64_t first_ns = 0, last_ns = 0;
    std::uint64_t gaps = 0;  // numbers that are not there
    std::uint64_t last_number = 0;
  };
  std::map<std::pair<StreamType, std::uint64_t>, Epoch> epochs;
  std::map<std::string, std::uint64_t> reasons;
  std::int64_t missed = 0;
  double largest_force = 0;
  RecordingReader reader(options.file);
  Record record;
  HapticTick tick;
  while (reader.Next(record)) {
    Epoch& epoch = epochs[{record.type, record.epoch}];
    if (epoch.messages++ == 0) {
      epoch.first_ns = record.received.stamp_ns;
    } else {
      epoch.gaps += record.received.number - epoch.last_number - 1;
    }
    epoch.last_number = record.received.number;
    epoch.last_ns = record.received.stamp_ns;
    if (!record.Is(tick)) continue;
    missed += MissedBefore(tick);
    for (std::uint32_t i = 0; i < tick.pointer_count; ++i) {
      const Pointer& pointer = tick.pointers[i];
      ++reasons[Key(pointer.reason)];
      largest_force =
          std::max(largest_force, std::hypot(pointer.force[0], pointer.force[1], pointer.force[2]));
    }
  }
  const std::map<StreamType, const char*> names{
      {StreamType::kHapticTick, "haptic.tick"},   {StreamType::kHapticHealth, "haptic.health"},
      {StreamType::kWorldFrame, "world.frame"},   {StreamType::kWorldHealth, "world.health"},
      {StreamType::kWorldBodies, "world.bodies"}, {StreamType::kWorldScene, "world.scene"}};
  for (const auto& [key, epoch] : epochs) {
    const auto name = names.find(key.first);
    std::printf(
        "%-14s epoch %llu: %llu messages over %.3f s",
        name == names.end() ? "unknown" : name->second, static_cast<unsigned long long>(key.second),
        static_cast<unsigned long long>(epoch.messages), Seconds(epoch.last_ns - epoch.first_ns));
    const bool thinned =
        key.first == StreamType::kHapticHealth || key.first == StreamType::kWorldHealth;
    if (!thinned) std::printf(", %llu missing", static_cast<unsigned long long>(epoch.gaps));
    std::printf("\n");
  }
  std::printf("deadlines missed: %lld\nlargest force: %.3f N\n", static_cast<long long>(missed),
              largest_force);
  for (const auto& [reason, count] : reasons) {
    std::printf("%-16s %llu ticks\n", reason.c_str(), static_cast<unsigned long long>(count));
  }
  if (reader.torn()) std::printf("the file ends within a message: its writer was stopped there\n");
  return kExitOk;
}

// What the export must know of a frame.
struct FrameNote {
  std::uint64_t stamp_ns = 0;
  std::uint32_t planes = 0;
};

void WriteRow(std::ostream& out, const HapticTick& tick, std::uint64_t epoch,
              std::uint64_t first_ns, const FrameNote* frame) {
  const Pointer& pointer = tick.pointers[0];
  ImpulseUnits impulse = tick.ground.impulse;
  for (std::uint32_t i = 0; i < tick.channel_count; ++i) {
    impulse = Plus(impulse, tick.channels[i].impulse);
  }
  out << Seconds(tick.start_ns - first_ns) << ',' << epoch << ',' << tick.tick << ','
      << static_cast<double>(tick.previous_duration_ns) * 1e-3 << ',' << MissedBefore(tick) << ','
      << Key(pointer.reason);
  for (const auto* vector : {&pointer.position, &pointer.velocity, &pointer.force}) {
    for (const double value : *vector) out << ',' << value;
  }
  out << ',' << tick.world_epoch << ',' << tick.world_frame << ',';
  if (frame != nullptr) {
    const auto age_ns = static_cast<std::int64_t>(tick.start_ns - frame->stamp_ns);
    out << frame->planes << ',' << static_cast<double>(age_ns) * 1e-6;
  } else {
    out << ',';
  }
  for (const std::int64_t units : impulse) out << ',' << static_cast<double>(units) * kImpulseUnit;
  out << '\n';
}

int Export(const Options& options) {
  // A tick may stand before the frame that it displays.
  std::map<std::pair<std::uint64_t, std::uint64_t>, FrameNote> frames;  // by epoch and number
  Record record;
  {
    RecordingReader reader(options.file);
    WorldFrame frame;
    while (reader.Next(record)) {
      if (!record.Is(frame)) continue;
      frames[{record.epoch, frame.frame}] = {record.received.stamp_ns, frame.plane_count};
    }
  }
  std::ofstream file;
  if (!options.out.empty()) {
    file.open(options.out);
    if (!file) throw StartError(kExitFault, options.out + ": cannot be written");
  }
  std::ostream& out = options.out.empty() ? std::cout : file;
  out.precision(17);
  out << "start_s,epoch,tick,previous_duration_us,missed_before,reason,x_m,y_m,z_m,vx_m_per_s,"
         "vy_m_per_s,vz_m_per_s,fx_n,fy_n,fz_n,world_epoch,world_frame,planes,feature_age_ms,"
         "impulse_x_ns,impulse_y_ns,impulse_z_ns\n";
  RecordingReader reader(options.file);
  HapticTick tick;
  std::uint64_t first_ns = 0;
  while (reader.Next(record)) {
    if (!record.Is(tick)) continue;
    if (first_ns == 0) first_ns = tick.start_ns;
    const auto frame = frames.find({tick.world_epoch, tick.world_frame});
    WriteRow(out, tick, record.epoch, first_ns, frame == frames.end() ? nullptr : &frame->second);
  }
  out.flush();
  if (!out) throw StartError(kExitFault, "writing the CSV failed");
  if (reader.torn()) std::cerr << "haptic_log: the recording ends within a message\n";
  return kExitOk;
}

int Run(const Options& options) {
  try {
    if (options.verb == "record") return RecordPair(options);
    if (options.verb == "info") return PrintInfo(options);
    return Export(options);
  } catch (const SegmentError& error) {
    throw StartError(error.exit_code(), error.what());
  } catch (const RecordingError& error) {
    throw StartError(kExitFault, error.what());
  }
}

}  // namespace
}  // namespace rikiseki::protocol

int main(int argc, char** argv) {
  return rikiseki::RunProgram(
      "haptic_log", [&] { return rikiseki::protocol::Run(rikiseki::protocol::Parse(argc, argv)); });
}
