// The three services of a live server, and calls as promises.
//
//   import {call, exchange, ingest, mission, obstacle, send} from './calls.mjs';
//
// The program's arguments are HOST:PORT PROTO_ROOT; types are read from the
// contract there.

import assert from 'node:assert/strict';

import grpc from '@grpc/grpc-js';
import protoLoader from '@grpc/proto-loader';

export const [address, protoRoot] = process.argv.slice(2);
assert.ok(protoRoot, 'usage: node SCRIPT HOST:PORT PROTO_ROOT');

export const v1 = grpc.loadPackageDefinition(protoLoader.loadSync(
    ['ingest', 'mission', 'obstacle'].map(
        name => `fathom/v1/${name}_service.proto`),
    {includeDirs: [protoRoot], longs: Number, enums: String, defaults: true},
    )).fathom.v1;
// Calls of the contract that were made, and all that there are.
export const called = new Set();
export const contract = [v1.IngestService, v1.MissionService,
                         v1.ObstacleService]
    .flatMap(service => Object.keys(service.service));

const connect = Service => new Proxy(
    new Service(address, grpc.credentials.createInsecure()), {
      get(client, name) {
        if (contract.includes(name)) called.add(name);
        const member = client[name];
        return typeof member === 'function' ? member.bind(client) : member;
      }});
export const ingest = connect(v1.IngestService);
export const mission = connect(v1.MissionService);
export const obstacle = connect(v1.ObstacleService);

export const deadline = () => ({deadline: Date.now() + 60_000});

// A unary call as a promise.
export const call = (client, method, request) => new Promise((resolve, reject) =>
    client[method](request, deadline(), (error, response) =>
        error ? reject(error) : resolve(response)));

// A call that streams `requests` and answers once.
export const send = (client, method, requests) => new Promise((resolve, reject) => {
  const stream = client[method](deadline(), (error, response) =>
      error ? reject(error) : resolve(response));
  for (const request of requests) stream.write(request);
  stream.end();
});

// A call that streams both ways (or only back): all answers.
export const exchange = (stream, requests) => new Promise((resolve, reject) => {
  const answers = [];
  stream.on('data', answer => answers.push(answer));
  stream.on('error', reject);
  stream.on('end', () => resolve(answers));
  if (requests) {
    for (const request of requests) stream.write(request);
    stream.end();
  }
});

// Whether `actual` is within `tolerance` of `expected`.
export const near = (actual, expected, tolerance) => assert.ok(
    Math.abs(actual - expected) <= tolerance,
    `${actual} is not within ${tolerance} of ${expected}`);
