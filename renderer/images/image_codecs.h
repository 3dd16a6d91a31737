// SPDX-License-Identifier: Apache-2.0
// What decodes and encodes image files: OpenImageIO, for AVIF libavif, behind an interface that names neither. They
// need hundreds of shared libraries, so the command line opens it as a module when the first image is read or written;
// tests and other programs link it. What is common to both is this interface.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "renderer/images/attribute.h"
#include "renderer/images/byte_sink.h"

namespace braid {

enum class SampleType : uint8_t { Byte, LargerInteger, Half, Float, Double };

// Whether samples are linear light by custom, not encoded for a display.
inline bool isFloatingPoint(SampleType type) { return type >= SampleType::Half; }

// An image of a file, or one part of a file that has several.
struct ImageHeader {
  int width = 0, height = 0, depth = 1;
  int x = 0, y = 0;                    // of the first pixel in the full frame
  int fullWidth = 0, fullHeight = 0;   // to write, 0: as the image
  SampleType type = SampleType::Byte;  // the largest of any channel
  std::vector<std::string> channels;
  std::vector<SampleType> channelTypes;  // to write; empty: all are `type`
  int alpha = -1;                        // which channel
  std::vector<Attribute> attributes;

  // Of what is read:
  bool deep = false, unassociatedAlpha = false;
  int tileHeight = 0;  // 0: rows
  std::string part;
  std::string colourSpace;
};

class ImageReader {
 public:
  virtual ~ImageReader() = default;
  // OpenImageIO's name of the format, such as "openexr".
  virtual std::string format() const = 0;
  // False: there are fewer parts. The first one is selected in the beginning.
  virtual bool select(int part) = 0;
  // Of the part that is selected.
  virtual const ImageHeader& header() const = 0;
  // Rows [begin, end) of that part, counted from its first, all channels interleaved. Of tiles, whole rows of them.
  virtual bool readRows(int begin, int end, float* samples) = 0;
  // Whether the pixels of the first part are there, of formats that tell without room for them: readPixels() takes room
  // only then.
  virtual bool decode() { return true; }
  // The first channels of the whole first part, interleaved, as bytes or as floats.
  virtual bool readImage(int channels, SampleType type, void* samples) = 0;
  // Why something was false; maybe of several lines.
  virtual std::string takeError() = 0;
};

class ImageWriter {
 public:
  virtual ~ImageWriter() = default;
  // Rows [begin, end), in the types of the header, interleaved.
  virtual bool writeRows(int begin, int end, const void* samples) = 0;
  // All of them, of the one type of the header.
  virtual bool writeImage(const void* samples) = 0;
  virtual bool close() = 0;
  virtual std::string takeError() = 0;
};

// Where null comes back, `error` says why.
class ImageCodecs {
 public:
  // Colours of integers come without alpha multiplied into them, where the format can have it so.
  // Any file whose format is known, whatever its name.
  virtual std::unique_ptr<ImageReader> open(const std::string& path, std::string& error) const = 0;
  // By the format that the ending of the name says: `bytes` at `data`, which must outlive the reader, or, where that is
  // null, the file of that name.
  virtual std::unique_ptr<ImageReader> openNamed(const std::string& name, const uint8_t* data, size_t bytes,
                                                 std::string& error) const = 0;
  // `format` as ImageReader::format() or an ending without its dot; `name` is for messages. The sink must outlive the
  // writer.
  virtual std::unique_ptr<ImageWriter> create(const std::string& format, const std::string& name,
                                              const ImageHeader& header, ByteSink& sink, std::string& error) const = 0;

 protected:
  ~ImageCodecs() = default;
};

// Opens the module when it is called first, which takes a fraction of a second. Throws Error(OutputFailed) naming the
// file when that cannot be.
const ImageCodecs& imageCodecs();

}  // namespace braid
