// How a numbered message becomes bytes and an ack comes out of them: the parts
// of ping_stream.cc and contact_stream.cc that differ in types only. Internal
// to client/. Thread-safe.

#ifndef FATHOM_CLIENT_SEQUENCED_CODEC_H_
#define FATHOM_CLIENT_SEQUENCED_CODEC_H_

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/message_lite.h>
#include <grpcpp/impl/codegen/proto_utils.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/slice.h>
#include <grpcpp/support/status.h>

#include <cstddef>
#include <cstdint>

#include "client/sequenced_stream.h"

namespace fathom::client {

// Encodes a message whose only content is `message` in field `kField`, without
// copying `message` into one: a tag, the length, the bytes (protobuf's
// encoding guide, "Length-Delimited Records").
template <int kField, typename Message>
grpc::Slice EncodeInField(const Message& message) {
  using google::protobuf::io::CodedOutputStream;
  static_assert(kField < 16, "the tag must fit one byte");
  constexpr std::uint8_t kTag = (kField << 3) | 2;  // 2: length-delimited.
  const std::size_t size = message.ByteSizeLong();
  const auto size32 = static_cast<std::uint32_t>(size);
  grpc::Slice slice(1 + CodedOutputStream::VarintSize32(size32) + size);
  auto* out = const_cast<std::uint8_t*>(slice.begin());  // Not shared yet.
  *out++ = kTag;
  out = CodedOutputStream::WriteVarint32ToArray(size32, out);
  message.SerializeWithCachedSizesToArray(out);
  return slice;
}

// False if the bytes are not a Response. Empties `bytes`.
template <typename Response>
bool DecodeResponse(grpc::ByteBuffer* bytes, Response& response) {
  return grpc::GenericDeserialize<grpc::ProtoBufferReader, Response>(bytes,
                                                                     &response)
      .ok();
}

// The fields that both kinds of ack have.
template <typename Response>
IngestAck CommonAck(const Response& response) {
  IngestAck ack;
  ack.epoch = response.epoch();
  ack.applied_sequence = response.applied_sequence();
  ack.durable_sequence = response.durable_sequence();
  ack.map_revision = response.map_revision();
  ack.rejects.assign(response.rejects().begin(), response.rejects().end());
  ack.rejections.assign(response.rejections().begin(),
                        response.rejections().end());
  ack.gaps.assign(response.gaps().begin(), response.gaps().end());
  return ack;
}

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_SEQUENCED_CODEC_H_
