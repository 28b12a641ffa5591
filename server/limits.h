// Every bound of the server, each with its reason. All that a client can meet
// are published in GetMissionStatus; each has a test at the limit and one past
// it. At a bound the server refuses clearly (RESOURCE_EXHAUSTED, what and how
// much) and keeps serving.
//
// Constants only; nothing here is changed at run time.

#ifndef FATHOM_SERVER_LIMITS_H_
#define FATHOM_SERVER_LIMITS_H_

#include <chrono>
#include <cstddef>
#include <cstdint>

namespace fathom::server {

// ---- Messages ----

// Largest request message, bytes. 100 000 points with time offsets are about
// 3.0 MB, a 512 x 512 chart tile with stds 2.4 MB; 8 MiB holds both twice.
inline constexpr int kMaxMessageBytes = 8 * 1024 * 1024;

// Memory for what comes and goes on all connections, bytes: messages that are
// not yet whole, answers that are not yet read. Past it gRPC lets idle
// connections go (their clients come back), then ends streams until it fits;
// it does so beside the traffic, so a flood from many connections at once holds
// more for a moment (tests/integration/hostile_test.py).
inline constexpr size_t kMaxTransportBytes = 128 * 1024 * 1024;
// Calls at once on one connection, as HTTP/2 tells the client, which waits
// with more: all streams that the limits below allow, and 128 short calls.
inline constexpr int kMaxStreamsPerConnection = 512;
// A connection that was silent so long is asked for a sign of life, and is
// closed when none comes: a vehicle out of reach must not hold its streams.
inline constexpr std::chrono::seconds kKeepaliveTime{20};
inline constexpr std::chrono::seconds kKeepaliveTimeout{10};

// Most measurements in one ping. The SeaBat 8101 of the thesis has 101 beams;
// multibeams of today have 1024; 4096 leaves room and keeps a ping at 64 kB.
inline constexpr size_t kMaxBeamsPerPing = 4096;

// Most points in QueryObstacles: at 5-20 M points/s one request keeps a
// thread busy for 20 ms at most.
inline constexpr size_t kMaxPointsPerQuery = 100'000;

// Most waypoints in CheckTrajectory: a day's plan at one a ten seconds.
inline constexpr size_t kMaxWaypoints = 10'000;

// A contact's report or drop is refused if it is stamped further ahead of the
// server's clock. Simulations and clocks that run ahead are the sender's
// matter; milliseconds taken for seconds would close the contact to all true
// reports.
inline constexpr std::chrono::hours kMostAhead{24};

// Share of max_contacts from which GetMissionStatus warns.
inline constexpr double kContactsWarning = 0.9;

// Most cells of the map that one CheckTrajectory or FindNearestObstacle reads:
// one to four seconds of a thread, and at most 200 MB while it searches.
inline constexpr uint64_t kMaxSearchCells = 4'000'000;

// Most reports in ReportContacts: an AIS receiver hears a few hundred ships a
// minute; 1000 reports are one group commit.
inline constexpr size_t kMaxReportsPerRequest = 1000;

// Most cells in one DepthTile, 512 x 512: 2 MB with stds, below
// kMaxMessageBytes, and a few tens of milliseconds of the writer.
inline constexpr size_t kMaxTileCells = 512 * 512;

// Most chart cells in one import: a 16 000 x 16 000 raster. The map itself is
// bounded by max_cells; this bounds the time a stream may take.
inline constexpr uint64_t kMaxImportCells = 256'000'000;

// Chart cells after which an import under way is made durable, so that a crash
// costs the client at most so many again: about a second of checkpoint.
inline constexpr uint64_t kImportCheckpointCells = 4'000'000;

// Most cells in a GetRegion answer: 4096 x 4096, 270 MB on the wire.
inline constexpr uint64_t kMaxRegionCells = 16'777'216;

// Side of a GetRegion tile: 256 x 256 x 22 B = 1.4 MB, below the 4 MB that
// foreign gRPC clients accept by default.
inline constexpr uint32_t kRegionTileSide = 256;

// Estimates in one GetContactHistoryResponse (the contract says 1000).
inline constexpr size_t kHistoryEstimatesPerMessage = 1000;

// Most estimates in one GetContactHistory: a day at one a second; past it the
// client narrows the time range.
inline constexpr size_t kMaxHistoryEstimates = 100'000;

// Activities listed in GetMissionStatus.
inline constexpr size_t kMaxActivitiesListed = 1000;

// Rejections and gaps listed in one ack; beyond, only the counters tell.
inline constexpr int kMaxRejectionsPerAck = 100;
inline constexpr int kMaxGapsPerAck = 100;

// ---- Text ----

// Ids of sources, activities, vehicles and contacts.
inline constexpr size_t kMaxIdLength = 64;
// Names of missions, charts and datums.
inline constexpr size_t kMaxNameLength = 200;

// ---- Numbers ----

// Depths, metres below datum: above the highest building that a chart could
// mean and below the Challenger Deep (10 935 m).
inline constexpr double kMinDepthM = -100;
inline constexpr double kMaxDepthM = 12'000;
// Height of the water surface above datum: beyond any tide and surge.
inline constexpr double kMaxWaterLevelM = 50;
// Position std: worse than this a ping places nothing.
inline constexpr double kMaxPositionStdM = 100'000;
// Std of a depth. The leaf's code ends at 1000 m.
inline constexpr double kMaxDepthStdM = 1000;
// Clearance and radius of a query.
inline constexpr double kMaxClearanceM = 12'000;
inline constexpr double kMaxRadiusM = 50'000;
// Side of a local cell and of an area.
inline constexpr double kMinCellSizeM = 0.1;
inline constexpr double kMaxCellSizeM = 1000;
inline constexpr double kMaxAreaExtentM = 100'000;
// Ranges of a forward-looking sonar, and the one that stands for 0.
inline constexpr double kMaxSonarRangeM = 100'000;
inline constexpr double kDefaultMaxRangeM = 1000;
// Smoothing reaches at most so far; cells within d are touched per beam.
inline constexpr double kMaxSmoothingDistanceM = 1000;
// Finest and coarsest answer cell of GetRegion: past 100 km the arcs between
// a cell's corners bow too far to be bounded closely.
inline constexpr double kMinResolutionM = 0.1;
inline constexpr double kMaxResolutionM = 100'000;
// Radius of a vehicle on a trajectory, and its own position's std: a swept
// width of some kilometres at most.
inline constexpr double kMaxVehicleRadiusM = 1000;
inline constexpr double kMaxVehicleStdM = 1000;
// Step of a chart's grid, degrees.
inline constexpr double kMaxStepDeg = 10;
// How far before and behind the base time a point of a batch may lie: 10
// years keeps every sum far inside int64.
inline constexpr int64_t kMaxTimeOffsetUs = 315'360'000'000'000;

// ---- Queues, threads, times ----

// Ingest messages that wait for the writer or the disk. At 200 k pings/s it
// is 20 ms, one group commit.
inline constexpr size_t kMaxPendingIngest = 4096;
// The same in bytes, for large pings: 32 MiB.
inline constexpr size_t kMaxPendingIngestBytes = 32 * 1024 * 1024;
// Commands (start, transfer, import tile, ...) that wait. Each holds at most
// one chart tile: 2 MB.
inline constexpr size_t kMaxPendingCommands = 64;
// Messages that the writer applies before it publishes a view.
inline constexpr size_t kMaxMessagesPerView = 256;
// Under a stream of messages a view comes at most so often, as often as a group
// commit: each copies the blocks that were written since the last (some 60 kB
// for the swath of one ping) and each contact that was heard of, so twenty
// pings that share one cost a twentieth. A message that comes alone never
// waits.
inline constexpr std::chrono::microseconds kViewInterval{2000};
// How often an idle writer looks whether readers have unpacked tiles of the
// global map beyond the budget (only if any is packed): two busy processors
// unpack 20 to 40 MB meanwhile at worst, and a look costs 1 us.
inline constexpr std::chrono::milliseconds kTileBudgetInterval{50};
// The same for group commits, the design's shortest (2-20 ms): each costs a
// transaction and an fsync, however little it holds.
inline constexpr std::chrono::microseconds kCommitInterval{2000};

// Concurrent ingest streams: one a vehicle or feeder; each holds at most one
// message in hand.
inline constexpr int kMaxIngestStreams = 64;
// Concurrent imports.
inline constexpr int kMaxImports = 4;
// Concurrent GetRegion and GetContactHistory streams: each holds at most
// 1.5 MB of a region or 30 MB of a history for its reader.
inline constexpr size_t kMaxBulkStreams = 64;
// Threads for them and for digests: one on a vehicle's second core, two
// ashore; gRPC's own stay free for short calls.
inline constexpr size_t kWorkerThreads = 2;
// CheckTrajectory and FindNearestObstacle calls at once, under way or waiting
// for a thread: each holds at most 0.4 MB of waypoints.
inline constexpr size_t kMaxSearches = 256;
// Threads for them, apart from the bulk streams': an avoidance loop must not
// queue behind 64 exports.
inline constexpr size_t kSearchThreads = 2;
// Threads that help with a batch of points: most that are started, one fewer
// than the machine has cores.
inline constexpr size_t kMaxBatchHelpers = 7;
// WatchRegion, WatchContacts and WatchTrajectory calls at once: some screens
// and planners for each of kMaxIngestStreams vehicles. Each holds one message
// (of a region 6 kB, of contacts 25 kB) and, of a region, one bit for
// kWatchTileSide squared cells.
inline constexpr int kMaxWatchers = 256;
// The part of them that watch trajectories: each may cost kMaxWatchCells cells
// after every change.
inline constexpr int kMaxTrajectoryWatchers = 32;
// Most cells of the map that a watched trajectory reads: 60 ms, so that the
// alert comes within 100 ms. (10 km at 10 m with 50 m to each side: 10 000.)
inline constexpr uint64_t kMaxWatchCells = 200'000;
// Blocks and tiles of the map, and contacts, that are remembered as changed,
// each once, for watchers that lag or resume: 2.5 MB. A survey that breaks new
// ground, ten blocks of 32 m a second, goes on for 25 minutes.
inline constexpr size_t kMaxKeptChanges = 16'384;
// More changed at once (a chart, a transfer) count as one change of everywhere.
inline constexpr size_t kMaxAreasAtOnce = 4096;
// Side of the tiles in which a watched region is told, cells: a ping changes
// few of them, and 16 x 16 cells are made in 0.3 ms.
inline constexpr uint32_t kWatchTileSide = 16;
// Estimates in one ContactBatch (the contract says 100): 25 kB. At 1000 reports
// a second five wait when a watcher is woken; a first message, or one to a slow
// reader, has more.
inline constexpr size_t kEstimatesPerBatch = 100;
// Changes are looked for at most so often, so that twenty views of the map
// share the work.
inline constexpr std::chrono::milliseconds kWatchInterval{5};
// How often a watcher hears that nothing he watches has changed, while the map
// goes on.
inline constexpr std::chrono::milliseconds kWatchProgressInterval{1000};
// A trajectory is judged anew at most so often.
inline constexpr std::chrono::milliseconds kTrajectoryInterval{20};
// Changes are followed for so long after the last watcher has gone, so that one
// who was cut off finds what he missed.
inline constexpr std::chrono::milliseconds kWatchLinger{60'000};
// Queries that wait for a min_revision.
inline constexpr size_t kMaxRevisionWaiters = 1024;
// Longest wait for a min_revision when the client sets no deadline.
inline constexpr std::chrono::milliseconds kMaxRevisionWait{10'000};
// How long before the client's deadline such a wait gives up, so that
// UNAVAILABLE still reaches it.
inline constexpr std::chrono::milliseconds kRevisionWaitMargin{20};

// What RetryInfo suggests when ingest is refused.
inline constexpr std::chrono::milliseconds kRetryDelay{1000};
// How long SIGTERM waits for calls to end before it cuts them.
inline constexpr std::chrono::milliseconds kDrainTime{10'000};

// Journal records after which the writer makes a snapshot. Replay runs at 150
// k records/s or more, so a start after kill -9 takes 0.3 s more at most.
inline constexpr size_t kJournalMaxRecords = 20'000;
// Contact reports that count as one: they take a tenth of a ping's room, and a
// snapshot of 100 contacts takes as long as 4000 of their reports.
inline constexpr size_t kReportsPerJournalRecord = 2;
// How long the storage thread waits before it tries again after a fault.
inline constexpr std::chrono::milliseconds kStorageRetryDelay{250};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_LIMITS_H_
