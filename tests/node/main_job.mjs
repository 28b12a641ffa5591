// The main job from a second language: chart, activity, pings, questions and
// status through @grpc/grpc-js, with types read from the contract.
//
//   node main_job.mjs HOST:PORT PROTO_ROOT
//
// The mission is new and covers 41.5 N 71.4 W. Exit code 0: all held.

import assert from 'node:assert/strict';

import grpc from '@grpc/grpc-js';

import {
  address, call, deadline, exchange, ingest, mission, near, obstacle, send,
} from './calls.mjs';

const place = {latitudeDeg: 41.5, longitudeDeg: -71.4};
const time = {seconds: 1_767_225_600, nanos: 0};

const status = await call(mission, 'GetMissionStatus', {});
assert.equal(status.verticalDatum, 'MLLW');
assert.equal(status.stamp.mapRevision, 0);
assert.equal(status.limits.maxMessageBytes, 8 * 1024 * 1024);

const unknown = await call(obstacle, 'QueryObstacle',
    {position: place, depthM: 20, confidence: 0.95});
assert.equal(unknown.answer.state, 'OBSTACLE_STATE_UNKNOWN');

// A chart of 20 x 20 cells about the place: 30 m, 1 sigma 4 m.
const imported = await send(mission, 'ImportPrior', [
  {header: {name: 'chart'}},
  {tile: {
    northWest: {latitudeDeg: 41.51, longitudeDeg: -71.41},
    latitudeStepDeg: 0.001, longitudeStepDeg: 0.001, rows: 20, columns: 20,
    depthM: Array(400).fill(30), stdM: [4],
  }},
]);
assert.equal(imported.cellsWithDepth, 400);

// P(D <= 26), D ~ N(30, 4^2): Phi(-1) = 0.158655.
const chart = await call(obstacle, 'QueryObstacle',
    {position: place, depthM: 26, confidence: 0.8});
near(chart.answer.probability, 0.158655, 1e-4);
assert.equal(chart.answer.state, 'OBSTACLE_STATE_FREE');
assert.equal(chart.answer.seabed.kind, 'EVIDENCE_KIND_PRIOR');

const started = await call(mission, 'StartActivity', {
  activityId: 'bay', vehicleId: 'node', time, parameters: {
    southWest: {latitudeDeg: 41.499, longitudeDeg: -71.402},
    northExtentM: 300, eastExtentM: 400, cellSizeM: 10,
    estimator: 'ESTIMATOR_KALMAN',
  }});
assert.equal(started.activity.cellsNorth, 30);

// 100 pings of one beam straight ahead (east), 50 m from the place. Prior
// N(30, 16) and 100 soundings N(20, 9), eqs. 4.18 and 4.20: information
// 1/16 + 100/9 = 11.17361, std 0.299162, mean
// (30/16 + 20 * 100/9) / 11.17361 = 20.05594.
const pings = Array.from({length: 100}, (_, i) => ({ping: {
  sourceId: 'node', epoch: 1, sequence: i + 1, activityId: 'bay', time,
  pose: {position: place, depthM: 2, headingDeg: 90},
  rangeM: [50], bearingDeg: [0], depthM: [20], stdM: [3],
}}));
const acks = await exchange(ingest.StreamPings(deadline()), pings);
const last = acks.at(-1);
assert.equal(last.durableSequence, 100);
assert.equal(last.pingsApplied, 100);
assert.equal(last.measurementsAccepted, 100);
const again = await exchange(ingest.StreamPings(deadline()), pings);
assert.equal(again.at(-1).pingsDuplicate, 100);
assert.equal(again.at(-1).measurementsAccepted, 0);

// 50 m east at 41.5 N: 50 / 83490 degrees.
const measured = {latitudeDeg: 41.5, longitudeDeg: -71.4 + 50 / 83490};
const question = {position: measured, depthM: 20.05594, confidence: 0.95,
                  minRevision: last.mapRevision};
const answered = await call(obstacle, 'QueryObstacle', question);
assert.equal(answered.answer.seabed.kind, 'EVIDENCE_KIND_MEASURED');
near(answered.answer.seabed.depthM, 20.05594, 1e-3);
near(answered.answer.seabed.stdM, 0.299162, 1e-3);
near(answered.answer.probability, 0.5, 5e-3);
assert.equal(answered.answer.state, 'OBSTACLE_STATE_UNCERTAIN');

const batch = await call(obstacle, 'QueryObstacles', {
  latitudeDeg: [41.5, 41.5, 41.6], longitudeDeg: [
    measured.longitudeDeg, measured.longitudeDeg, -71.4],
  depthM: [10, 30, 10], confidence: 0.95});
assert.deepEqual(batch.state, ['OBSTACLE_STATE_FREE',
  'OBSTACLE_STATE_OCCUPIED', 'OBSTACLE_STATE_UNKNOWN']);

const region = await exchange(obstacle.GetRegion({
  southWest: {latitudeDeg: 41.499, longitudeDeg: -71.402},
  northEast: {latitudeDeg: 41.5, longitudeDeg: -71.4}, resolutionM: 10,
}, deadline()));
assert.equal(region.reduce((sum, r) => sum + r.tile.depthM.length, 0),
             region[0].totalRows * region[0].totalColumns);

// A refusal comes with its code, its field and its binary details.
await assert.rejects(
    call(obstacle, 'QueryObstacle', {...question, confidence: 2}),
    error => error.code === grpc.status.INVALID_ARGUMENT &&
        error.details.startsWith('confidence') &&
        error.metadata.get('grpc-status-details-bin').length === 1);

const done = await call(mission, 'CompleteActivity', {activityId: 'bay'});
assert.equal(done.transfer.localCells, 1);
const after = await call(obstacle, 'QueryObstacle',
    {...question, minRevision: done.mapRevision});
assert.equal(after.answer.seabed.layer, 'MAP_LAYER_GLOBAL');
near(after.answer.seabed.depthM, 20.05594, 0.05);

for (const client of [ingest, mission, obstacle]) client.close();
console.log(`main job of ${address}: all held`);
