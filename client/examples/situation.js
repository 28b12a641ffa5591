#!/usr/bin/env node
// Situational awareness in a terminal: the chart around a place, what moves on
// it, and what is nearest - with @grpc/grpc-js, no code generated.
//
//   npm install @grpc/grpc-js @grpc/proto-loader
//   node situation.js 127.0.0.1:7430 /usr/share/fathom/proto 41.5,-71.4 10
//
// The last argument is the vehicle's depth in metres. The chart shows 2 km x
// 2 km: '#' OCCUPIED at that depth, '.' FREE, '?' between, ' ' UNKNOWN, 'A',
// 'B', ... contacts, '@' the place itself.

const grpc = require('@grpc/grpc-js');
const protoLoader = require('@grpc/proto-loader');

const SIDE_M = 2000;
const CELLS = 40;
const CONFIDENCE = 0.95;

const [address, protoRoot, placeText, depthText] = process.argv.slice(2);
if (!depthText) {
  console.error('usage: situation.js SERVER PROTO_ROOT LAT,LON DEPTH_M');
  process.exit(1);
}
const [latitudeDeg, longitudeDeg] = placeText.split(',').map(Number);
const depthM = Number(depthText);

// The contract's own files are all that a client needs.
const {v1} = grpc.loadPackageDefinition(protoLoader.loadSync(
    'fathom/v1/obstacle_service.proto',
    {includeDirs: [protoRoot], enums: String, defaults: true})).fathom;
const map = new v1.ObstacleService(
    address, grpc.credentials.createInsecure());

// A unary call as a promise, with a deadline as every call should have one.
const ask = (method, request) => new Promise((resolve, reject) =>
  map[method](request, {deadline: Date.now() + 10_000},
              (error, answer) => error ? reject(error) : resolve(answer)));

const north = metres => metres / 111_132;
const east = metres =>
  metres / (111_320 * Math.cos(latitudeDeg * Math.PI / 180));

// One batch for the whole picture: all answers from one view of the map.
async function picture() {
  const request = {latitudeDeg: [], longitudeDeg: [], depthM: [],
                   confidence: CONFIDENCE};
  for (let row = 0; row < CELLS; ++row) {
    for (let column = 0; column < CELLS; ++column) {
      const at = i => ((i + 0.5) / CELLS - 0.5) * SIDE_M;
      request.latitudeDeg.push(latitudeDeg - north(at(row)));
      request.longitudeDeg.push(longitudeDeg + east(at(column)));
      request.depthM.push(depthM);
    }
  }
  const {state, stamp} = await ask('QueryObstacles', request);
  const signs = {OBSTACLE_STATE_FREE: '.', OBSTACLE_STATE_OCCUPIED: '#',
                 OBSTACLE_STATE_UNCERTAIN: '?', OBSTACLE_STATE_UNKNOWN: ' '};
  const rows = Array.from({length: CELLS}, (_, row) =>
    state.slice(row * CELLS, (row + 1) * CELLS).map(s => signs[s]));
  return {rows, revision: stamp.mapRevision};
}

async function main() {
  const {rows, revision} = await picture();
  const mark = (lat, lon, sign) => {
    const row = Math.floor(CELLS / 2 - (lat - latitudeDeg) / north(SIDE_M) *
                           CELLS);
    const column = Math.floor(CELLS / 2 + (lon - longitudeDeg) /
                              east(SIDE_M) * CELLS);
    if (rows[row]?.[column]) rows[row][column] = sign;
  };
  const {contacts} = await ask('ListContacts', {});
  contacts.forEach((contact, i) => mark(
      contact.position.latitudeDeg, contact.position.longitudeDeg,
      String.fromCharCode(65 + i % 26)));
  mark(latitudeDeg, longitudeDeg, '@');
  console.log(rows.map(row => row.join('')).join('\n'));

  console.log(`revision ${revision}, ${contacts.length} contacts`);
  contacts.forEach((contact, i) => console.log(
      `${String.fromCharCode(65 + i % 26)} ` +
      `${contact.sourceId}/${contact.contactId} ` +
      `${contact.velocityNorthMS.toFixed(1)} m/s north, ` +
      `${contact.velocityEastMS.toFixed(1)} m/s east`));
  const nearest = await ask('FindNearestObstacle', {
    position: {latitudeDeg, longitudeDeg}, depthM, confidence: CONFIDENCE,
    searchRadiusM: 5000, treatUnknownAs: 'UNKNOWN_TREATMENT_FREE'});
  console.log(nearest.found ?
    `nearest: ${nearest.contactId || 'sea floor'} ` +
        `${nearest.distanceM.toFixed(0)} m, ` +
        `bearing ${nearest.bearingDeg.toFixed(0)}` :
    'nearest: nothing within 5000 m');
}

main().then(() => map.close(), error => {
  console.error(error.message);
  process.exit(1);
});
