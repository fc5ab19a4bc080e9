#!/usr/bin/env bash
# Takes the fix of each hard numerical case, and what bidirectional estimates rest on, out of a copy of the source, one at
# a time, and requires the case's test to fail: what a test cannot notice it does not protect. More than half an hour on
# two cores, nearly all of it builds.
#
#     tests/planted.sh [PART OF A NAME]
#     tests/planted.sh --check                # builds nothing: can every fault still be planted?
#
# A copy of the working tree and its builds are kept in target/planted.
set -u
cd "$(dirname "$0")/.."
only=${1:-} check=
[ "$only" != --check ] || { only= check=yes; }
tree=$PWD/target/planted/tree
export CARGO_TARGET_DIR=$PWD/target/planted/build CARGO_INCREMENTAL=1
rm -rf "$tree"
mkdir -p "$tree"
# With the times of the files, so that cargo builds only what has changed.
git ls-files -z | tar --null --create --files-from=- | tar --extract --directory="$tree"

missed=0
tried=0
# plant NAME FILE SUBSTITUTION TEST: a Perl substitution over the whole file; a test of the library is lib::its::name, of
# frames, formats and the viewer frames::its::name, formats::its::name and viewer::its::name.
plant() {
    local name=$1 file=$2 change=$3 test=$4
    case $name in *"$only"*) ;; *) return ;; esac
    tried=$((tried + 1))
    local target="-p opsr-cli --no-default-features --test it"
    case $test in
    stability_train::*) target="-p opsr-cli --test it" ;;
    lib::*) target="-p opsr --lib" test=${test#lib::} ;;
    frames::*) target="-p opsr-frames --lib" test=${test#frames::} ;;
    viewer::*) target="-p opsr-view --lib" test=${test#viewer::} ;;
    formats::*) target="-p opsr-formats --lib" test=${test#formats::} ;;
    esac
    cp "$tree/$file" "$tree/../original"
    perl -0pi -e "$change" "$tree/$file"
    local verdict
    if cmp -s "$tree/$file" "$tree/../original"; then
        verdict="NOT PLANTED: $file has changed"
        missed=$((missed + 1))
    elif [ "$check" ]; then
        verdict="can be planted"
    else
        (cd "$tree" && cargo test --release $target "$test" -- --exact) >"$tree/../log" 2>&1
        if grep -q "^test $test .*FAILED" "$tree/../log"; then
            verdict="found by $test"
        else
            verdict="MISSED by $test: $(grep -E '^(error|test )' "$tree/../log" | head -1)"
            missed=$((missed + 1))
        fi
    fi
    # With the time of now, or cargo would not see it.
    cat "$tree/../original" >"$tree/$file"
    echo "$name: $verdict"
}

plant "1 smooth below the Dirac bound" src/bsdf/lobes.rs \
    's/alpha < DELTA_ALPHA/alpha < 0.95 * DELTA_ALPHA/g' stability::case_1_the_dirac_bound
plant "1 the path remembers the roughened lobe" src/integrator/walk/roughening.rs \
    's/scattered\(point\.alpha,/scattered(point.alpha_reg,/' stability::case_1_delta_lobes_keep_their_roughness_in_the_path
plant "2 quantiles of 0 and 1" src/bsdf/slope.rs \
    's/u\.clamp\(3e-8, 1\.0 - 6e-8\)/u/' stability::case_2_sampling_at_extreme_random_numbers
plant "3 the printed form" table/src/roughness.rs \
    's/\(last \+ \(1\.0 - last\) \* q \* shrink\)/(1.0 - (1.0 - last) * (1.0 - q * shrink))/' \
    stability::cases_3_to_5_path_roughness
plant "4 an edge off by a bit" table/src/roughness.rs \
    's/0\.069_187_1/0.069_187_2/' stability::cases_3_to_5_path_roughness
plant "4 a roughness that is no number" src/scene/load/materials.rs \
    's/!x\.is_finite\(\) \|\| x < 0\.0/false/' load::broken::load_refuses_every_invalid_value_by_place
plant "5 long paths forget" table/src/roughness.rs \
    's/self\.append\(folded\)/self.append(alpha + 0.0 * folded)/' stability::cases_3_to_5_path_roughness
plant "6 weights as quotients of densities" src/math/measure.rs \
    's/1\.0 \/ \(1\.0 \+ q \/ p\)/p \/ (p + q)/' stability::case_6_mis_weights_of_extreme_densities
plant "7 rays that end on the light" src/scene/mod.rs \
    's/(light\.cos;\s+ray\.t_max = \()distance - slack/$1distance - 0.0 * slack/' stability::case_7_light_sampling_near_and_far
plant "8 Fresnel with a difference of squares" src/bsdf/fresnel.rs \
    's/\(eta - 1\.0\) \* \(eta \+ 1\.0\) \+ cos \* cos/eta * eta * (1.0 - (1.0 - cos * cos) \/ (eta * eta))/' \
    stability::case_8_fresnel_and_interfaces
plant "9 sides by the shading normal" src/integrator/walk/shading_point.rs \
    's/self\.surface\.allows_direction\(light\.wi, wi\.z\)/true/' \
    stability::cases_9_and_10_light_leaks
plant "9 normals bent to the mirror horizon of the view" src/scene/normals.rs \
    's/\(c \+ least\) \* ng/(c - least) * ng/' \
    lib::unit::appearance::ripples_seen_from_low_are_not_black
plant "9 rough lobes that graze the surface" src/scene/geometry.rs \
    's/MIN_COS_ROUGH\n/MIN_COS_SMOOTH\n/' \
    lib::unit::appearance::white_furnace_of_coarse_balls_shows_no_rim
plant "10 rays that start on the surface" src/scene/geometry.rs \
    's/to_world\.error\(rounding \+ 1e-13 \* extent\)/0.0 * (rounding + 1e-13 * extent)/' \
    stability::case_10_scale_invariance
plant "11 paths that carry nothing go on" src/integrator/walk/mod.rs \
    's/self\.throughput == Rgb::ZERO && pending\.is_zero\(\)/false \&\& pending.is_zero()/' \
    stability::case_11_zero_throughput_ends_the_path
plant "11 survivors weigh as before" src/integrator/walk/mod.rs \
    's/self\.throughput \/= survival;//' stability::case_11_russian_roulette_is_unbiased
plant "12 moments in single precision" src/math/moments.rs \
    's/self\.mean \+= delta \/ f64::from\(self\.n\);/self.mean = (self.mean + delta \/ f64::from(self.n)).as_vec3().as_dvec3();/' \
    stability::case_12_welford_variance
plant "13 pixels that are no numbers" crates/metric/src/lib.rs \
    's/!p\.is_finite\(\)/p.x == f32::NEG_INFINITY/' metric::pictures_that_cannot_be_compared_are_errors
plant "14 corners that are no numbers" src/scene/load/mesh.rs \
    's/!p\.iter\(\)\.all\(\|x\| x\.is_finite\(\)\)/p.is_empty()/' load::broken::load_refuses_broken_bytes
plant "14 triangles without area" src/scene/geometry.rs \
    's/\.length\(\) > 0\.0/.length() >= 0.0/' lib::unit::geometry::degenerate_triangles_are_dropped_and_counted
plant "15 steps with a gradient of no numbers" crates/train/src/learn/outer_loop.rs \
    's/if loss\.is_finite\(\) && gradient\.iter\(\)\.all\(\|g\| g\.abs\(\) < MAX_DERIVATIVE\)/if gradient.len() < usize::MAX/' \
    stability_train::case_15_nan_gradients_leave_table_and_optimiser_unchanged
plant "15 a best loss of no number" crates/train/src/learn/outer_loop.rs \
    's/score\.filter\(\|s\| s\.is_finite\(\)\)/score/' stability_train::case_15_nan_loss_is_never_the_best
plant "a clear coat dims its base by one side" src/bsdf/clearcoated.rs \
    's/wo\.z\.abs\(\)\.min\(wi\.z\.abs\(\)\)/wo.z.abs()/' clearcoat::reciprocity_and_value_of_clearcoat_over_base
plant "a brushed lobe without its change of measure" src/bsdf/anisotropic.rs \
    's/query\.pdf_scale \*= factor;//' lib::unit::anisotropy::anisotropic_value_and_pdf_are_those_of_two_roughnesses
plant "slopes of the isotropic Gaussian" src/bsdf/slope.rs \
    's/\(quantiles\.w \+ sum\.dot\(quantiles\.along\)\)/quantiles.w/' bsdf::chi_square_of_sample_against_pdf

plant "Sobol points that are not scrambled" src/sampler/sobol.rs \
    's/scramble\(digits\[d\], seeds\[d\]\)/digits[d]/' lib::sampler::sobol::tests::chi_square_of_one_sample_over_sequences
plant "one order for all sets of a path" src/sampler/sobol.rs \
    's/u64::from\(set\)\.wrapping_mul/0u64.wrapping_mul/' lib::unit::sampler::agreement_of_sobol_and_independent_samples
plant "the same light paths for every sample" src/sampler/mod.rs \
    's/seed\.0 \^ block \^ u64::from\(sample\)/seed.0 ^ block/' lib::sampler::tests::light_paths_of_neighbours_cover_directions
plant "light paths in the order of lines" src/sampler/mod.rs \
    's/SobolPoint::new\(key, interleaved\(x, y\)\)/SobolPoint::new(key, path)/' lib::sampler::tests::light_paths_of_neighbours_cover_directions
plant "a guided direction weighed by its BSDF alone" src/integrator/guided/directions.rs \
    's/self\.share \* pdf_w \+ \(1\.0 - self\.share\) \* region\.tree\.pdf\(wi\)/pdf_w/' \
    guided::agreement_of_guided_paths_with_path
plant "a Dirac lobe beside a guide without its probability" src/integrator/guided/directions.rs \
    's/sample\.weight \/= self\.share;//' guided::agreement_of_guided_paths_with_path
plant "blurred noise is weighed by the bright side of an edge" src/resolve/layer.rs \
    's/own\.max\(DARK \* \*dark\)/*own/' lib::resolve::tests::blur_leaves_dark_pixels_beside_noise_dark
plant "a pixel on an edge is like neither surface" src/resolve/guide.rs \
    's/\(square\(0\) \+ square\(1\) \+ square\(2\) - spread\)\.max\(0\.0\)/square(0) + square(1) + square(2)/' \
    lib::resolve::tests::gaussian_filter_keeps_constants_and_a_pixel_without_light_stays_black
plant "textures are no edges of blurs along rough surfaces" src/resolve/guide.rs \
    's/let reflectance = \(8\.\.FEATURES\)/let reflectance = (4..7)/' \
    lib::resolve::tests::a_difference_of_reflectance_is_an_edge_of_both_surfaces
plant "the reflectance of a covered surface is that of the drawn lobe" src/scene/mod.rs \
    's/Some\(finish\) if finish\.covers\(\) \&\& finish\.mix\.is_none\(\)/Some(finish) if finish.mix.is_some()/' \
    lib::unit::aov::aov_albedo_under_covers_has_no_noise
plant "the second way through glass counts as the first" src/integrator/walk/ways.rs \
    's/chance: 1\.0 - one\.chance/chance: one.chance/' lib::integrator::walk::ways::tests::ways_are_all_leaves_of_a_tree
plant "ways of small shares end and nothing makes up for it" src/integrator/walk/mod.rs \
    's/self\.throughput \/= chance;//' lib::unit::bidirectional::ways::agreement_with_drawn_ways_behind_a_pane
plant "light at the end of an edge counts without the roulette of ways" src/integrator/walk/mod.rs \
    's/pending\.scale\(Rgb::splat\(1\.0 \/ chance\)\);//' lib::unit::ways::agreement_of_paths_on_both_ways_with_drawn_ones
plant "every way of levels counts in full" src/integrator/levels/packed.rs \
    's/share \* \*value/*value/' lib::unit::ways::agreement_of_levels_on_both_ways_with_drawn_ones
plant "light layers count every way in full" src/integrator/aov.rs \
    's/share \* part/part/' lib::unit::aov::aov_light_split_adds_up_and_equals_short_paths
plant "a reflection at glass is drawn" src/integrator/bidirectional/paths.rs \
    's/Ways::all\(\)/Ways::drawn()/' lib::unit::bidirectional::ways::glass_shows_what_it_reflects_and_what_is_behind_it_in_every_sample
plant "camera walks end inside dark glass" src/integrator/bidirectional/paths.rs \
    's/!dirac_only\s+\&\& n >=/n >=/' lib::unit::bidirectional::ways::dark_glass_adds_no_noise_to_what_is_behind_it
plant "walks behind dark glass end early" src/integrator/bidirectional/paths.rs \
    's/walk\.reset_roulette\(\);//' lib::unit::bidirectional::ways::dark_glass_adds_no_noise_to_what_is_behind_it
plant "a polished wall guides blurs by what its base scatters to" src/integrator/walk/features.rs \
    's/const BASE: f32 = 0\.04/const BASE: f32 = 4.0/' lib::unit::bidirectional::blurred::guides_of_a_polished_wall_are_its_own
plant "photons count at the radius that first reaches them alone" src/integrator/bidirectional/merge.rs \
    's/sum \+= sums\[level\]/sum = sums[level]/' lib::unit::bidirectional::radii::levels_are_pictures_at_their_radii
plant "light by way of casters counts twice" src/integrator/path/mod.rs \
    's/\&\& directions\.counts\(arrival\.as_ref\(\)\)//' manifold::manifold_sampling_has_the_picture_of_path_tracing
plant "what was not met is free of noise" src/resolve/coarse.rs \
    's/self\.variance \* \(-self\.expected \* times\)\.exp\(\)/self.variance * 0.0/' \
    lib::resolve::tests::light_that_a_level_has_not_met_is_not_dark
plant "darkness is never believed" src/resolve/coarse.rs \
    's/self\.variance \* \(-self\.expected \* times\)\.exp\(\)/self.variance/' \
    lib::resolve::tests::darkness_is_believed_where_hits_are_expected
plant "light that the sharpest level lacks is dark" src/resolve/coarse.rs \
    's/const AT_ONCE: f32 = 0.8/const AT_ONCE: f32 = 8.0/' \
    lib::resolve::tests::light_that_the_sharpest_level_lacks_comes_back_and_a_bias_does_not
plant "a bias counts as light that was not met" src/resolve/coarse.rs \
    's/const AT_ONCE: f32 = 0.8/const AT_ONCE: f32 = -8.0/' \
    lib::resolve::tests::light_that_the_sharpest_level_lacks_comes_back_and_a_bias_does_not
plant "variance over a pixel's own noisy mean" src/resolve/statement.rs \
    's/self\.variance <= .*length_squared\(\)/true/' lib::unit::statement::stated_error_of_rare_hits_is_the_true_one

plant "21 sheets are bodies" src/scene/shells.rs \
    's/const MAX_ESCAPES: f64 = 0.1/const MAX_ESCAPES: f64 = 1.0/' boundaries::pane_with_a_thickness_is_a_thin_wall
plant "21 turned triangles make overlaps" src/scene/bodies.rs \
    's/any\(\|material\| !turned\.contains\(material\)\)/next().is_some()/' \
    boundaries::turned_triangles_are_named_and_are_no_overlap
plant "22 photons divide by the whole disk" src/integrator/bidirectional/merge.rs \
    's/if scene\.inside_triangle\(&vertex\.surface, radius\)/if true/' \
    bidirectional::photons::photons_do_not_darken_thin_parts
plant "22 photons count what surfaces lie below" src/integrator/bidirectional/merge.rs \
    's/sum \+= 1\.0 \/ cos/sum += 0.9/' bidirectional::photons::photons_on_a_strip_have_the_density_of_a_plane
plant "23 no light samples at sharp lobes" src/integrator/bidirectional/merge.rs \
    's/total\.add_shared\(light\)/let _ = light/' \
    bidirectional::photons::photon_density_shows_lights_without_area_in_sharp_lobes
plant "23 lamps at sharp lobes count twice" src/integrator/bidirectional/merge.rs \
    's/_ => balance\(pdf_w, of_light\)/_ => 1.0 + 0.0 * balance(pdf_w, of_light)/' \
    bidirectional::photons::photon_density_counts_lamps_in_sharp_lobes_once
plant "24 the mean of shared light paths by pixels alone" src/integrator/bidirectional/sample.rs \
    's/push_shared/push/g' \
    lib::unit::mean_error::stated_error_of_the_mean_knows_photons_that_pixels_share
plant "24 photons of light paths that were cut count as of all" src/integrator/bidirectional/merge.rs \
    's/presence \* paths as f32/presence * self.paths as f32/' \
    lib::unit::stop::first_sample_by_shared_light_paths_ends_in_time_and_is_as_bright_as_a_whole_one
plant "light flux without the square of the index" src/integrator/bidirectional/walk.rs \
    's/refraction_scale \* cosines\.abs\(\)/cosines.abs()/' \
    lib::integrator::bidirectional::audit::cases::audit_of_mis_weights_and_values_under_water
plant "light flux with geometric cosines at a bent normal" src/integrator/bidirectional/walk.rs \
    's/vertex\.back\.dot\(frame\.n\), out\.dot\(frame\.n\)/vertex.back.dot(vertex.surface.ng), out.dot(vertex.surface.ng)/' \
    lib::integrator::bidirectional::audit::cases::audit_of_mis_weights_and_values_under_water
plant "reverse density is the forward one" src/integrator/bidirectional/walk.rs \
    's/vertex\.pdf_back\(out\)/vertex.pdf_on(out)/' \
    lib::integrator::bidirectional::audit::cases::audit_of_mis_weights_and_values_of_materials
plant "aimed light without its density" src/scene/light/aim.rs \
    's/self\.uniform \* uniform \+ self\.targets\.iter\(\)\.map\(part\)\.sum::<f32>\(\)/self.uniform * uniform/' \
    lib::unit::bidirectional::ends::chi_square_of_aimed_points
plant "light samples weighed as if emission chose them" src/scene/light/emission.rs \
    's/pdf \* \(self\.emission_pmf\(k\) \/ light\.pmf\)/pdf/' \
    lib::integrator::bidirectional::audit::cases::audit_of_mis_weights_among_many_lights
plant "emission behind a pane counts in full" src/integrator/path/mod.rs \
    's/emission\.scale\(next\.sample\.weight\);/emission = PendingEmission::of(EmissionWeight::full(point.throughput * next.sample.weight));/' \
    panes::naive_tracer_agrees_on_panes_with_path_tracing
plant "photons of a shared bucket count twice" src/integrator/bidirectional/photons.rs \
    's/if buckets\[\.\.i\]\.contains\(&buckets\[i\]\)/if buckets[i] == u32::MAX/' \
    lib::integrator::bidirectional::photons::tests::cells_that_share_a_bucket_count_no_photon_twice
plant "weights of connections ignore merges" src/integrator/bidirectional/weights.rs \
    's/if self\.merges \{ merging\.m \}/if false { merging.m }/' lib::integrator::bidirectional::weights::tests::mis_weights_equal_enumeration_in_double_precision
plant "every strategy roughens a part of its own" src/integrator/bidirectional/split.rs \
    's/reach\.join\(&there\.reach\)/there.reach.best/' lib::integrator::bidirectional::audit::cases::audit_of_the_split
plant "a first sample that is cut at once has no pixels" src/integrator/pieces.rs \
    's/ && !\(piece < least && self\.is_first\(\)\)//' lib::unit::stop::first_sample_that_is_cut_at_once_has_its_first_pixels
plant "one level: the wide blur is blurred twice" src/resolve/tiles.rs \
    's/\(sigma \* sigma - BASE \* BASE\)\.sqrt\(\)/sigma/' lib::resolve::tests::blur_of_a_blur_in_steps_is_a_wide_gaussian
plant "one level: the wide blur takes too few pixels" src/resolve/tiles.rs \
    's/const STEP: usize = 3/const STEP: usize = 6/' lib::resolve::tests::blur_of_a_blur_in_steps_is_a_wide_gaussian
plant "one level: tiles have too little around them" src/resolve/tiles.rs \
    's/_ => reach\(rest\(WIDE\)\) \+ reach\(BASE\)/_ => reach(3.0)/' \
    lib::resolve::tests::resolve_in_tiles_has_the_bytes_of_the_whole
plant "levels: light that all share has no wide blur" src/resolve/tiles.rs \
    's/self\.blurs\(&guide, &\[&capped\], !keeps_glints\)/self.blurs(\&guide, \&[\&capped], false)/' \
    lib::resolve::tests::shared_light_is_blurred
plant "one level: chance counts as it stands" src/resolve/layer.rs \
    's/\(share \* \*bias\)\.min\(\*most\)/share * *bias/' lib::resolve::tests::an_even_floor_has_no_pepper
plant "resolve: lone choices stay" src/resolve/layer.rs \
    's/&& share < least\n/\&\& share < 0.0\n/' lib::resolve::tests::lone_choices_give_way_and_features_stay
plant "resolve: a lone choice takes the blur of another level" src/resolve/tiles.rs \
    's/all\.len\(\) \+ count - first\)/all.len() + 1)/' export::resolve::c_chooses_as_the_library_does
plant "one level: discs of fireflies" src/resolve/tiles.rs \
    's/self\.cap\(&mut only\);//' lib::resolve::tests::one_level_makes_no_discs_of_glints_and_fireflies
plant "one level: discs of glints" src/resolve/tiles.rs \
    's/GLINT: f32 = 1\.2/GLINT: f32 = 1e9/' lib::resolve::tests::one_level_blurs_reflections_without_their_glints
plant "photons: light of the first level alone" src/pilot/photons.rs \
    's/for level in 1\.\.levels\.levels/for level in 9..levels.levels/' lib::pilot::photons::tests::light_of_the_best_level_counts
plant "photons: pictures are one" src/pilot/photons.rs \
    's/\(mean, squares \/ \(n \* \(n - 1\.0\)\)\)/(mean, squares \/ (n * n * n))/' lib::pilot::photons::tests::one_bright_picture_is_no_proof
plant "photons: a stop waits for them" src/pilot/photons.rs \
    's/stop: view\.stop,/stop: None,/' witness::photons_do_not_delay_a_stop
plant "photons: every region counts as the first" src/pilot/photons.rs \
    's/\(y \* grid\.y \/ frame\.y \* grid\.x \+ x/(0 * y * grid.x + x/' lib::pilot::photons::tests::means_over_regions_count_every_pixel_once
plant "film: no light counts as wrong" crates/frames/src/average.rs \
    's/difference - wide\.variance_of_difference\(narrow\)/-wide.variance_of_difference(narrow)/' \
    frames::tests::moving_shadow_is_not_smeared
plant "film: noise counts as wrong light" crates/frames/src/average.rs \
    's/difference - wide\.variance_of_difference\(narrow\)/difference/' frames::tests::noise_of_a_still_light_is_divided
plant "film: regions are not compared" crates/frames/src/average.rs \
    's/REGION_WEIGHT \* square\(pair\)/0.0 * square(pair)/' frames::tests::dimming_lamp_keeps_its_energy
plant "film: hidden places count" crates/frames/src/reproject.rs \
    's/\(-sum\)\.exp\(\)/1.0/' frames::tests::surfaces_are_found_between_pixels
plant "film: moving surfaces stay where they are" crates/frames/src/reproject.rs \
    's/self\.place = match steps/let _ = match steps/' frames::tests::surfaces_move_with_their_triangles
plant "film: surfaces move back" crates/frames/src/reproject.rs \
    's/true => &from\.surfaces\.after,\n            false => &from\.surfaces\.before/true => &from.surfaces.before,\n            false => &from.surfaces.after/' \
    frames::tests::surfaces_move_with_their_triangles
plant "film: a place by corners in another order" crates/frames/src/surfaces.rs \
    's/hit\.u \* \(b - a\) \+ hit\.v \* \(c - a\)/hit.v * (b - a) + hit.u * (c - a)/' \
    frames::tests::surfaces_move_with_their_triangles
plant "film: pixels between pixels are not mixed" crates/frames/src/reproject.rs \
    's/let part = at - corner/let part = (at - corner).round()/' frames::tests::surfaces_are_found_between_pixels
plant "film: the first frames are lost" crates/frames/src/sequence.rs \
    's/self\.frames\.len\(\) > self\.done \+ WIDEST/self.frames.len() > self.done + 2 * WIDEST/' \
    frames::tests::frames_come_in_order_and_of_one_size
plant "film: the stated error stays" crates/frames/src/average.rs \
    's/error_of_less_noise\(f64::from\(ratio\(i\)\)/error_of_less_noise(1.0/' frames::tests::noise_of_a_still_light_is_divided
plant "film: bright samples are no noise" crates/frames/src/average.rs \
    's/frame\.squares\.get\(i\) \{/None::<\&f32> {/' frames::tests::bright_samples_are_noise
plant "resolve: two batches count as four" src/resolve/tiles.rs \
    's/let batches = self\.whole\.roughened\.count/let batches = BATCHES/' lib::resolve::tests::two_samples_are_resolved
plant "resolve: two batches are believed as four" src/resolve/layer.rs \
    's/SIGNIFICANT \* BATCHES as f32 \/ b/SIGNIFICANT/' lib::resolve::tests::an_even_floor_has_no_pepper
plant "resolve: a denoised picture of two samples states an error" src/resolve/denoised.rs \
    's/Resolved::unknown\(&film\)/resolved/' \
    lib::resolve::tests::failures_of_a_filter_are_handed_on_and_few_samples_are_filtered_as_they_are
plant "resolve: a denoiser is judged by the samples that it has seen" src/resolve/denoised.rs \
    's/one \* \(a - other\) \+ two \* \(b - raw\)/one * (a - raw) + two * (b - other)/' \
    lib::resolve::tests::a_filter_is_believed_as_far_as_it_is_right
plant "pilot: no clock ends a race" src/pilot/mod.rs \
    's/so_far > 0\.0 && before/so_far < 0.0 \&\& before/' lib::unit::pilot::race_ends_where_paths_are_slow_and_time_is_short
plant "resolve: a denoised picture is as noisy as its halves" src/resolve/denoised.rs \
    's/ - 0\.25 \* \(a - b\) \* \(one - two\)//' lib::resolve::tests::share_of_a_filter_is_that_of_the_least_error
plant "photons: lists of light paths double" src/integrator/bidirectional/photons.rs \
    's/list\.reserve_exact\(end\.max\(length\) - list\.len\(\)\)/list.reserve(length)/' \
    lib::integrator::bidirectional::photons::tests::lists_grow_to_the_length_that_is_expected
plant "normals: matt surfaces bend as mirrors do" src/scene/mod.rs \
    's/surface\.min_mirror_cos = normals::MIN_COS_MATT;//' lib::unit::appearance::relief_of_matt_surfaces_does_not_depend_on_the_view
plant "normals: facets hide light from themselves" src/scene/normals.rs \
    's/height \+= weight \* /height += 0.0 * weight * /' lib::unit::appearance::shadow_of_a_coarse_ball_begins_where_that_of_a_fine_one_does
plant "lighting: a tint of emission is a picture" src/scene/lighting.rs \
    's/ && self\.emitted >= VISIBLE \* self\.reflected//' lib::unit::own_light::lamps_light_and_decoration_does_not
plant "resolve: a pixel leaves out the first cell around it" src/resolve/guide.rs \
    's/let first = most\.saturating_sub\(shift\);/let first = most.saturating_sub(shift) + edge;/' \
    lib::resolve::tests::values_of_cells_are_a_gaussian_mean_of_those_around
plant "resolve: a filter takes the rows of the next pixel" src/resolve/filter.rs \
    's/&along\[y % N \* width/&along[(y + 1) % N * width/' lib::resolve::tests::tent_is_the_mean_of_means_at_any_radius
plant "resolve: the batch that differs most confirms itself" src/resolve/layer.rs \
    's/Vec3A::select\(largest, Vec3A::ZERO, \*d\)/*d/' lib::resolve::tests::one_batch_confirms_no_difference
plant "resolve: pixels in the row below confirm nothing" src/resolve/layer.rs \
    's/rows\.get\(i \+ width\)/rows.get(i + 2 * width)/' lib::resolve::tests::a_pixel_beside_confirms_a_difference
plant "resolve: an error map of the noise alone" src/resolve/mod.rs \
    's/statement::smoothed\(self\.picture\.size\(\), errors\)/statement::smoothed(self.picture.size(), errors.map(|e| 0.6 * e))/' \
    lib::unit::statement::error_map_has_the_mean_that_is_stated
plant "formats: differences of meshopt turn the wrong way" crates/formats/src/compressed/meshopt.rs \
    's/rotate_right/rotate_left/' formats::compressed::tests::channels_of_turned_differences_are_decoded
plant "formats: a known vertex is new again" crates/formats/src/compressed/meshopt.rs \
    's/if low == 0 \|\| low >= 13/if low < 16/' load::compressed::compressed_meshes_are_those_of_the_reference_decoders
plant "formats: streams of Draco share accessors" crates/formats/src/compressed/draco.rs \
    's/filled\.get\(&i\) == Some\(&stream\)/filled.contains_key(\&i)/' \
    load::compressed::draco_streams_do_not_mix_where_primitives_share_accessors
plant "formats: a fallback is read" src/scene/load/codecs.rs \
    's/\(!has_bytes \|\| marked\(codec\.extension\)\)/!has_bytes/' \
    load::compressed::compressed_meshes_are_those_of_the_reference_decoders
plant "formats: six faces are a picture" crates/formats/src/compressed/ktx.rs \
    's/faces != 1/faces == 0/' load::compressed::ktx2_faults_name_their_image
plant "formats: textures of OBJ stand on their heads" crates/formats/src/obj.rs \
    's/if flip \{ 1\.0 - uv\.y \}/if flip { uv.y }/' foreign::models::models_of_all_formats_are_one_mesh
plant "formats: offsets of OBJ maps go down" crates/formats/src/mtl.rs \
    's/1\.0 - map\.scale\.y - map\.offset\.y/1.0 - map.scale.y + map.offset.y/' \
    foreign::models::textures_of_obj_files_lie_as_the_file_says
plant "formats: shares of pbrt-v3 are those of version 4" crates/formats/src/pbrt/materials.rs \
    's/vec!\[second\.to_owned\(\), first\.to_owned\(\)\]/vec![first.to_owned(), second.to_owned()]/' \
    foreign::nearest::mixtures_have_their_shares
plant "formats: the lightest parts of a mixture" crates/formats/src/lib.rs \
    's/b\.0\.total_cmp\(&a\.0\)/a.0.total_cmp(&b.0)/' foreign::nearest::mixtures_have_their_shares
plant "formats: maps of pbrt-v3 are mirrored" crates/formats/src/pbrt/lights.rs \
    's/DVec3::NEG_X\);/DVec3::X);/' foreign::nearest::maps_of_pbrt_3_shine_from_where_they_say
plant "formats: the end of a movement moves its beginning" crates/formats/src/pbrt/mod.rs \
    's/if self\.state\.at_end \{/if false {/' foreign::nearest::movements_are_shown_as_they_begin
plant "formats: meshes are not painted" crates/formats/src/mitsuba/bsdfs.rs \
    's/has_colors = true/has_colors = false/' foreign::nearest::mesh_colours_of_mitsuba_paint_what_asks_for_them
plant "studio: the floor lies above the lowest point" src/scene/floor.rs \
    's/low\.y - GAP/low.y + GAP/' lib::unit::own_light::objects_stand_on_the_floor_of_the_studio
plant "studio: the floor is too narrow" src/scene/floor.rs \
    's/RADIUS: f64 = 6\.0/RADIUS: f64 = 3.0/' lib::unit::own_light::floor_of_the_studio_has_a_shadow_and_no_rim
plant "studio: the floor is too bright" src/scene/light/sky.rs \
    's/FLOOR_ALBEDO: f32 = 0\.16745/FLOOR_ALBEDO: f32 = 0.169/' \
    lib::scene::light::sky::tests::studio_and_sky_are_finite_and_not_negative_and_the_studio_is_neutral
plant "studio: the camera frames the floor" src/scene/framing.rs \
    's/parts\.meshes\.len\(\) - usize::from\(parts\.has_floor\)/parts.meshes.len()/' \
    lib::unit::own_light::objects_stand_on_the_floor_of_the_studio
plant "studio: a ground gets a floor" src/scene/framing.rs \
    's/around\(&subject\)\.filter\(\|_\| !surrounded\)/around(&subject).filter(|_| true || surrounded)/' \
    lib::unit::own_light::objects_stand_on_the_floor_of_the_studio
plant "studio: the floor moves with the objects" src/render/open.rs \
    's/lay_floor\(loaded\.rest\.as_ref\(\)\)/lay_floor(None)/' load::motion::floor_of_the_studio_stays_at_every_moment
plant "view: the camera turns at the depth of the floor" crates/view/src/work.rs \
    's/\(!is_floor\)\.then/(true || is_floor).then/' view::view_knows_the_objects_of_a_studio
plant "view: pictures of fewer pixels are raw" crates/view/src/preview.rs \
    's/= settings\(request, &viewpoint\.settings\);/= Settings { amounts: Amounts::Raw, ..settings(request, &viewpoint.settings) };/' \
    viewer::work::tests::young_pictures_are_resolved
plant "view: one sample of a whole frame is shown" crates/view/src/work.rs \
    's/run\.samples > 1 && due/due/' viewer::work::tests::first_sample_of_a_frame_waits_for_the_second
plant "drive: errors are estimated at every number of samples" src/integrator/drive.rs \
    's/error \* fall\(self\.next\) > limit\.bound/false/' lib::unit::stop::errors_are_estimated_where_they_may_be_low_enough
plant "drive: a resumed render estimates no error where it stands" src/integrator/drive.rs \
    's/while next < samples/while next <= samples/' lib::unit::stop::errors_are_estimated_where_they_may_be_low_enough
plant "view: the floor is an object" crates/view/src/open_scene.rs \
    's/\(!is_floor\)\.then_some/(true || is_floor).then_some/' view::view_knows_the_objects_of_a_studio
plant "merges: lights allow them" src/integrator/bidirectional/walk.rs \
    's/merge_rule\.beside_lights\.then_some\(true\)/Some(true)/' \
    lib::integrator::bidirectional::audit::cases::audit_of_mis_weights_and_values_of_materials
plant "merges: a connection checks one end alone" src/integrator/bidirectional/connect.rs \
    's/allows\(light\)/true/' \
    lib::integrator::bidirectional::audit::cases::audit_of_mis_weights_and_values_of_materials
plant "merges: emission counts those beside the light" src/integrator/bidirectional/connect.rs \
    's/hit\(&walk\.arrived/hit(&vertex.partial/' \
    lib::integrator::bidirectional::audit::cases::audit_of_mis_weights_and_values_under_water
plant "merges: all photons merge" src/integrator/bidirectional/photons.rs \
    's/if vertex\.merges \{/if true {/' \
    bidirectional::photons::photons_do_not_darken_thin_parts
plant "resolve: halves of one sample take light across edges" src/resolve/mod.rs \
    's/first\[i\] \* rough\[i\]/1.0 + 0.0 * first[i] * rough[i]/' \
    lib::resolve::tests::one_sample_is_resolved_as_two_halves
plant "translucent: the other side has the reflectance" src/bsdf/translucent.rs \
    's/false => \(self\.transmitted/false => (self.gloss.albedo/' bsdf::translucent_surface_reflects_and_transmits_what_it_says
plant "translucent: the sides change their densities" src/bsdf/translucent.rs \
    's/let \[_, reflected, transmitted\]/let [_, transmitted, reflected]/' bsdf::chi_square_of_sample_against_pdf
plant "translucent: light walks take the surface for opaque" src/bsdf/mod.rs \
    's/Self::Anisotropic\(_\) \| Self::FresnelGlossy\(_\)/Self::Anisotropic(_) | Self::FresnelGlossy(_) | Self::Translucent(_)/' \
    lib::unit::bidirectional::strategies::agreement_of_each_strategy_through_translucent_sheets
plant "layers: one number decides two of them" src/scene/layers.rs \
    's/\*u = \(\*u - opacity\) \/ \(1\.0 - opacity\);//' opacity::stacked_layers_show_the_product_of_their_opacities
plant "layers: hidden backs dim a light path's connection to the camera" src/integrator/walk/mod.rs \
    's/scene\.has_panes\(\) \|\| scene\.has_layers\(\)/scene.has_panes()/' opacity::agreement_of_path_and_bdpt_through_hidden_backs
plant "first sample: bdpt is not tried in place of vcm" src/pilot/first_sample.rs \
    's/\.chain\(others\)/.chain([])/' lib::pilot::first_sample::tests::dearest_contender_that_fits_replaces_one_that_does_not
plant "first sample: it has the time of the render" src/integrator/stop.rs \
    's/FIRST_OVERRUN: u32 = 2/FIRST_OVERRUN: u32 = 1/' lib::integrator::stop::tests::first_sample_has_twice_the_time_and_at_least_half_a_second
plant "caustics: those of large lamps count as rare" src/integrator/bidirectional/caustics.rs \
    's/RARE: f64 = 1000\.0/RARE: f64 = 1.0/' \
    lib::integrator::bidirectional::caustics::tests::share_of_a_mirrors_caustic_is_that_of_its_light
plant "caustics: those of mirrors call for no photons" src/pilot/mod.rs \
    's/CAUSTICS: f64 = 0\.005/CAUSTICS: f64 = 1.0/' \
    lib::unit::pilot::pilot_chooses_the_integrator_of_the_suite_scenes

echo "$tried planted, $missed of them not found"
[ "$tried" -gt 0 ] && [ "$missed" -eq 0 ]
