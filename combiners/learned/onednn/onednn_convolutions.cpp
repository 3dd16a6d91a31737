// SPDX-License-Identifier: Apache-2.0
#include "combiners/learned/onednn/onednn_convolutions.h"

#include <utility>

#include <oneapi/dnnl/dnnl.hpp>

// Of the OpenMP runtime that oneDNN was linked with. Weak: one that was built without has none.
extern "C" {
__attribute__((weak)) int omp_get_max_threads();
__attribute__((weak)) void omp_set_num_threads(int threads);
}

namespace braid {

namespace {

using dnnl::memory;
using Kind = memory::data_type;

// oneDNN plans and runs with as many threads as the calling one may start; braid's tiles are its parallelism, and how
// sums are ordered must not depend on the machine's threads.
class OneThread {
 public:
  OneThread() : before_(omp_get_max_threads ? omp_get_max_threads() : 1) { set(1); }
  ~OneThread() { set(before_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  static void set(int threads) {
    if (omp_set_num_threads) omp_set_num_threads(threads);
  }
  int before_;
};

// The processor. Of its own, never destroyed: threads may outlive static objects of a module.
const dnnl::engine& engine() {
  static const auto* one = new dnnl::engine(dnnl::engine::kind::cpu, 0);
  return *one;
}

// What the fastest instructions of the processor take at once.
int blockSize() {
  switch (dnnl::get_effective_cpu_isa()) {
    case dnnl::cpu_isa::sse41:
    case dnnl::cpu_isa::avx:
    case dnnl::cpu_isa::avx2:
    case dnnl::cpu_isa::avx2_vnni:
      return 8;
    default:
      return 16;
  }
}

memory::format_tag blocked() { return blockSize() == 8 ? memory::format_tag::nChw8c : memory::format_tag::nChw16c; }

class OneDnnConvolution : public Convolution {
 public:
  OneDnnConvolution(const dnnl::convolution_forward::primitive_desc& plan, memory weights, memory bias)
      : in_(plan.src_desc()),
        out_(plan.dst_desc()),
        scratchpad_(plan.scratchpad_desc()),
        convolution_(plan),
        weights_(std::move(weights)),
        bias_(std::move(bias)) {}

  size_t scratchValues() const override { return (scratchpad_.get_size() + sizeof(float) - 1) / sizeof(float); }

  bool run(const float* in, float* out, float* scratch) const override try {
    const OneThread alone;
    dnnl::stream stream(engine());
    convolution_.execute(stream, {{DNNL_ARG_SRC, memory(in_, engine(), const_cast<float*>(in))},
                                  {DNNL_ARG_DST, memory(out_, engine(), out)},
                                  {DNNL_ARG_WEIGHTS, weights_},
                                  {DNNL_ARG_BIAS, bias_},
                                  {DNNL_ARG_SCRATCHPAD, memory(scratchpad_, engine(), scratch)}});
    stream.wait();
    return true;
  } catch (const dnnl::error&) {
    return false;
  }

 private:
  memory::desc in_, out_, scratchpad_;
  dnnl::convolution_forward convolution_;
  memory weights_, bias_;
};

class OneDnnLayer : public ConvolutionLayer {
 public:
  explicit OneDnnLayer(const ConvolutionWeights& given)
      : inputs_(given.inputs),
        outputs_(given.outputs),
        kernel_(given.kernel),
        relu_(given.relu),
        weights_(copied({outputs_, inputs_, kernel_, kernel_}, memory::format_tag::oihw, given.weights)),
        bias_(copied({outputs_}, memory::format_tag::x, given.bias)) {}

  std::unique_ptr<Convolution> prepare(const ConvolutionSize& size, std::string& error) override try {
    const OneThread alone;
    const auto plan = planned(size);
    return std::make_unique<OneDnnConvolution>(plan, ordered(plan.weights_desc()), bias_);
  } catch (const dnnl::error& e) {
    error = e.what();
    return nullptr;
  }

  size_t bytes() const override {
    size_t sum = weights_.get_desc().get_size();
    for (const memory& known : ordered_) sum += known.get_desc().get_size();
    return sum;
  }

 private:
  static memory copied(const memory::dims& sizes, memory::format_tag order, const std::vector<float>& values) {
    memory held({sizes, Kind::f32, order}, engine());
    std::copy(values.begin(), values.end(), static_cast<float*>(held.get_data_handle()));
    return held;
  }

  // The weights in an order that the library asked for; sizes agree on few.
  const memory& ordered(const memory::desc& order) {
    for (const memory& known : ordered_)
      if (known.get_desc() == order) return known;
    ordered_.emplace_back(order, engine());
    dnnl::stream stream(engine());
    dnnl::reorder(weights_, ordered_.back()).execute(stream, weights_, ordered_.back());
    stream.wait();
    return ordered_.back();
  }

  // Winograd's algorithm takes less than half of the time where there are enough channels, and rounds as finely here.
  // Few processors have it, and for some sizes it wants the memory of a whole layer.
  dnnl::convolution_forward::primitive_desc planned(const ConvolutionSize& size) const {
    constexpr memory::dim kEnough = 32;
    if (kernel_ == 3 && inputs_ >= kEnough && outputs_ >= kEnough) try {
        const auto plan = planned(size, dnnl::algorithm::convolution_winograd);
        if (plan.scratchpad_desc().get_size() <= kConvolutionScratch) return plan;
      } catch (const dnnl::error&) {
      }
    return planned(size, dnnl::algorithm::convolution_direct);
  }

  dnnl::convolution_forward::primitive_desc planned(const ConvolutionSize& size, dnnl::algorithm algorithm) const {
    const memory::dim width = size.left + size.width + size.right - kernel_ + 1,
                      height = size.top + size.height + size.bottom - kernel_ + 1;
    const dnnl::convolution_forward::desc wanted(
        dnnl::prop_kind::forward_inference, algorithm, {{1, inputs_, size.height, size.width}, Kind::f32, blocked()},
        {{outputs_, inputs_, kernel_, kernel_}, Kind::f32, memory::format_tag::any},
        {{outputs_}, Kind::f32, memory::format_tag::x}, {{1, outputs_, height, width}, Kind::f32, blocked()}, {1, 1},
        {size.top, size.left}, {size.bottom, size.right});
    dnnl::primitive_attr attributes;
    attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
    if (relu_) {
      dnnl::post_ops after;
      after.append_eltwise(1, dnnl::algorithm::eltwise_relu, 0, 0);
      attributes.set_post_ops(after);
    }
    return {wanted, attributes, engine()};
  }

  memory::dim inputs_, outputs_, kernel_;
  bool relu_;
  memory weights_, bias_;
  std::vector<memory> ordered_;
};

class OneDnn final : public ConvolutionLibrary {
 public:
  int block() const override { return blockSize(); }
  std::unique_ptr<ConvolutionLayer> layer(const ConvolutionWeights& weights, std::string& error) const override try {
    return std::make_unique<OneDnnLayer>(weights);
  } catch (const dnnl::error& e) {
    error = e.what();
    return nullptr;
  }
};

}  // namespace

const ConvolutionLibrary& oneDnnConvolutions() {
  static const OneDnn library;
  return library;
}

}  // namespace braid
