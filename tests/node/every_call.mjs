// Every call of the contract through @grpc/grpc-js, each with an answer worked
// out by hand.
//
//   node every_call.mjs HOST:PORT PROTO_ROOT
//
// The mission is new and covers 41.5 N 71.4 W. Exit code 0: all held.

import assert from 'node:assert/strict';

import {
  address, call, called, contract, deadline, exchange, ingest, mission, near,
  obstacle, send,
} from './calls.mjs';

// Metres of a degree about 41.5 N, good to 0.1 %.
const NORTH_M = 111_073;
const EAST_M = 83_490;
const place = (north, east) => ({latitudeDeg: 41.5 + north / NORTH_M,
                                 longitudeDeg: -71.4 + east / EAST_M});
const at = seconds => ({seconds: 1_767_225_600 + seconds, nanos: 0});

// --- The mission: a chart of 30 m +- 1 m, one cell of 3 m in it. ---

const imported = await send(mission, 'ImportPrior', [
  {header: {name: 'chart', importId: 'chart-1'}},
  {tile: {northWest: place(1500, -1000), latitudeStepDeg: 0.001,
          longitudeStepDeg: 0.001, rows: 25, columns: 40,
          depthM: Array(1000).fill(30), stdM: [1]}},
]);
assert.equal(imported.tiles, 1);
assert.equal((await call(mission, 'GetImport', {importId: 'chart-1'})).tiles,
             1);
assert.equal((await call(mission, 'GetImport', {importId: 'other'})).tiles, 0);

// Cells of 10 m that begin at the place itself.
await call(mission, 'StartActivity', {
  activityId: 'bay', time: at(0), parameters: {
    southWest: place(0, 0), northExtentM: 300, eastExtentM: 400,
    cellSizeM: 10, estimator: 'ESTIMATOR_KALMAN'}});
// From (105, 105) a beam east over 100 m: the cell from 200 m to 210 m.
const acks = await exchange(ingest.StreamPings(deadline()), [{ping: {
  sourceId: 'node', epoch: 1, sequence: 1, activityId: 'bay', time: at(0),
  pose: {position: place(105, 105), headingDeg: 90},
  rangeM: [100], bearingDeg: [0], depthM: [3], stdM: [0.0625]}}]);
assert.equal(acks.at(-1).measurementsAccepted, 1);

// --- Questions. ---

const question = {position: place(105, 205), depthM: 10, time: at(0),
                  confidence: 0.95};
// Prior N(30, 1), sounding N(3, 1/256): k = 1 / (1 + 1/256) = 256/257,
// mean 30 - 27 k = 3.105, P(D <= 10) = 1.
const one = await call(obstacle, 'QueryObstacle', question);
assert.equal(one.answer.state, 'OBSTACLE_STATE_OCCUPIED');
near(one.answer.seabed.depthM, 30 - 27 * 256 / 257, 1e-4);
const many = await call(obstacle, 'QueryObstacles', {
  latitudeDeg: [41.5 + 105 / NORTH_M, 41.5 + 105 / NORTH_M, 41.6],
  longitudeDeg: [-71.4 + 205 / EAST_M, -71.4 + 225 / EAST_M, -71.4],
  depthM: [10, 10, 10], time: at(0), confidence: 0.95});
assert.deepEqual(many.state, ['OBSTACLE_STATE_OCCUPIED', 'OBSTACLE_STATE_FREE',
                              'OBSTACLE_STATE_UNKNOWN']);

// East at 2 m/s from 105 m: the cell begins at 200 m, 47.5 s later; told no
// later, and earlier by (sqrt(1/2) - 1/2) 10 m at most: its corner's reach.
const checked = await call(obstacle, 'CheckTrajectory', {trajectory: {
  confidence: 0.95, waypoints: [
    {position: place(105, 105), depthM: 10, time: at(0)},
    {position: place(105, 305), depthM: 10, time: at(100)}]}});
assert.equal(checked.state, 'OBSTACLE_STATE_OCCUPIED');
const met = checked.firstConflict.time;
const metS = met.seconds - at(0).seconds + met.nanos * 1e-9;
assert.ok(metS < 47.6 && metS > 47.5 - 1.04 - 0.1, `${metS} s`);

const nearest = await call(obstacle, 'FindNearestObstacle', {
  position: place(105, 105), depthM: 10, time: at(0), confidence: 0.95,
  searchRadiusM: 500, treatUnknownAs: 'UNKNOWN_TREATMENT_FREE'});
assert.equal(nearest.found, true);
near(nearest.distanceM, 95, 0.2);
near(nearest.bearingDeg, 90, 0.5);

const region = await exchange(obstacle.GetRegion({
  southWest: place(0, 0), northEast: place(300, 400), resolutionM: 10,
}, deadline()));
const depths = region.flatMap(r => r.tile.depthM);
assert.equal(depths.length, region[0].totalRows * region[0].totalColumns);
near(Math.min(...depths), 3.105, 1e-3);
near(Math.max(...depths), 30, 1e-3);

// --- Contacts. ---

const report = (source, contact, sequence, second, east) => ({
  sourceId: source, epoch: 1, sequence, contactId: contact, time: at(second),
  contactClass: 'CONTACT_CLASS_VESSEL',
  fix: {position: place(0, east), velocityEastMS: 5}});
const reported = await call(ingest, 'ReportContacts',
                            {reports: [report('c4i', 'ship', 1, 0, 0)]});
assert.equal(reported.reportsApplied, 1);
const contactAcks = await exchange(ingest.StreamContacts(deadline()), [
  {report: report('radar', 'boat', 1, 0, 900)},
  {report: report('radar', 'boat', 2, 10, 950)}]);
assert.equal(contactAcks.at(-1).durableSequence, 2);
assert.equal(contactAcks.at(-1).reportsApplied, 2);

// Twenty seconds on at 5 m/s: 100 m, and 950 + 50 m.
const listed = await call(obstacle, 'ListContacts', {time: at(20)});
assert.deepEqual(listed.contacts.map(c => c.contactId), ['ship', 'boat']);
near((listed.contacts[0].position.longitudeDeg + 71.4) * EAST_M, 100, 0.5);
near((listed.contacts[1].position.longitudeDeg + 71.4) * EAST_M, 1000, 1);
const history = await exchange(obstacle.GetContactHistory(
    {sourceId: 'radar', contactId: 'boat'}, deadline()));
assert.deepEqual(
    history.flatMap(h => h.estimates).map(e => e.time.seconds - at(0).seconds),
    [0, 10]);
await call(mission, 'DropContact',
           {sourceId: 'radar', contactId: 'boat', time: at(30)});
const left = await call(obstacle, 'ListContacts', {time: at(40)});
assert.deepEqual(left.contacts.map(c => c.contactId), ['ship']);

// --- Watches: the state comes first. ---

const first = stream => new Promise((resolve, reject) => {
  stream.once('data', message => {
    stream.on('error', () => {});  // CANCELLED, by us.
    stream.cancel();
    resolve(message);
  });
  stream.once('error', reject);
});
const watchedContact = await first(
    obstacle.WatchContacts({}, deadline()));
assert.equal(watchedContact.estimate.sourceId, 'c4i');
const watchedBatch = await first(
    obstacle.WatchContacts({batched: true}, deadline()));
assert.equal(watchedBatch.batch.estimates[0].sourceId, 'c4i');
const watchedRegion = await first(obstacle.WatchRegion({region: {
  southWest: place(90, 190), northEast: place(120, 220), resolutionM: 10,
}}, deadline()));
near(Math.min(...watchedRegion.tile.depthM), 3.105, 1e-3);
const watchedWay = await first(obstacle.WatchTrajectory({trajectory: {
  confidence: 0.95, waypoints: [
    {position: place(105, 105), depthM: 10, time: at(0)},
    {position: place(105, 305), depthM: 10, time: at(100)}]}}, deadline()));
assert.equal(watchedWay.alert, true);
assert.equal(watchedWay.verdict.state, 'OBSTACLE_STATE_OCCUPIED');

// --- The file. ---

const moved = await call(mission, 'TransferLocalMap', {activityId: 'bay'});
assert.equal(moved.transfer.localCells, 1);
const done = await call(mission, 'CompleteActivity', {activityId: 'bay'});
assert.equal(done.transfer.localCells, 0, 'transferred already');
const saved = await call(mission, 'SaveMission', {fileName: 'copy.fathom'});
const verified = await call(mission, 'VerifyMission', {});
assert.equal(verified.ok, true);
const status = await call(mission, 'GetMissionStatus', {withDigest: true});
assert.equal(saved.mapDigest, status.mapDigest);
assert.equal(verified.mapDigest, status.mapDigest);

assert.deepEqual(contract.filter(name => !called.has(name)), []);
for (const client of [ingest, mission, obstacle]) client.close();
console.log(`every call of ${address}: all held`);
