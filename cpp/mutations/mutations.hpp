// The family of mutations: a new one is one file and one line here.
#pragma once

#include <array>
#include <string_view>
#include <tuple>

#include "mutations/aimed_perturbation.hpp"
#include "mutations/bidirectional.hpp"
#include "mutations/caustic_perturbation.hpp"
#include "mutations/glossy_caustic_perturbation.hpp"
#include "mutations/glossy_lens_perturbation.hpp"
#include "mutations/lens_perturbation.hpp"
#include "mutations/lens_subpath.hpp"
#include "mutations/multi_chain_perturbation.hpp"
#include "mutations/new_path.hpp"

namespace usdmlt {

using Mutations = std::tuple<NewPath, Bidirectional, LensPerturbation, CausticPerturbation,
                             MultiChainPerturbation, LensSubpath, GlossyLensPerturbation,
                             GlossyCausticPerturbation, AimedPerturbation>;

inline constexpr int mutation_count = static_cast<int>(std::tuple_size_v<Mutations>);

// Calls f<M>() with the mutation of that index.
template <typename F, size_t... I>
auto visit_mutation(int index, F&& f, std::index_sequence<I...>) {
    using Result = decltype(f.template operator()<NewPath>());
    Result result{};
    (void)((index == static_cast<int>(I) &&
            (result = f.template operator()<std::tuple_element_t<I, Mutations>>(), true)) ||
           ...);
    return result;
}
template <typename F>
auto visit_mutation(int index, F&& f) {
    return visit_mutation(index, std::forward<F>(f), std::make_index_sequence<mutation_count>{});
}

inline std::string_view mutation_name(int index) {
    return visit_mutation(index, []<typename M>() { return std::string_view(M::name); });
}

// Bit i: mutation i applies to x; of those of which the path's class and light decide it, or of the
// others.
template <bool by_class>
uint32_t applicable_mutations(const MutationContext& context, const Path& x) {
    return [&]<size_t... I>(std::index_sequence<I...>) {
        uint32_t mask = 0;
        const auto add = [&]<typename M>(int index) {
            if constexpr (M::by_class == by_class)
                mask |= uint32_t(M::applies(context, x)) << index;
        };
        (add.template operator()<std::tuple_element_t<I, Mutations>>(int(I)), ...);
        return mask;
    }(std::make_index_sequence<mutation_count>{});
}
inline uint32_t applicable_mutations(const MutationContext& context, const Path& x) {
    return applicable_mutations<true>(context, x) | applicable_mutations<false>(context, x);
}

}  // namespace usdmlt
