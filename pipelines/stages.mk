# Written by `paramreduce graph --format make`; do not edit.
# One rule per stage: `make results/ROBOT/reduction.h5` does just what is missing.
PARAMREDUCE ?= paramreduce
CONFIGS ?= configs
RESULTS ?= results
PARAMREDUCE_FLAGS ?=
# What must be there before paramreduce can be called, such as an installation.
PARAMREDUCE_READY ?=
# Files that a run of a robot makes, asked of the program once for each robot, and those of a list among them.
made = $(if $(made_$(1)),,$(eval made_$(1) := $(shell \
  $(if $(PARAMREDUCE_READY),$(MAKE) --silent $(PARAMREDUCE_READY) >&2 &&) \
  $(PARAMREDUCE) stages $(CONFIGS)/$(1).yaml $(PARAMREDUCE_FLAGS))))$(made_$(1))
if_made = $(addprefix $(RESULTS)/$(1)/,$(filter $(2),$(call made,$(1))))
.SECONDEXPANSION:

$(RESULTS)/%/log.h5: $(CONFIGS)/%.yaml | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) process-log $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/model.h5: $(CONFIGS)/%.yaml $$(call if_made,$$*,log.h5) | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) build-model $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/trajectories.h5: $(CONFIGS)/%.yaml $$(call if_made,$$*,model.h5) | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) optimize-trajectories $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/samples.h5: $(CONFIGS)/%.yaml $$(call if_made,$$*,model.h5 trajectories.h5 log.h5) | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) sample $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/reduction.h5: $(CONFIGS)/%.yaml $$(call if_made,$$*,model.h5 samples.h5) | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) reduce $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/terms.h5: $(CONFIGS)/%.yaml $$(call if_made,$$*,model.h5 samples.h5 reduction.h5) | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) reduce-terms $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/validation.h5: $(CONFIGS)/%.yaml $$(call if_made,$$*,model.h5 samples.h5 reduction.h5) | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) validate $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/identification.h5: $(CONFIGS)/%.yaml $$(call if_made,$$*,log.h5 model.h5 samples.h5 validation.h5) | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) identify $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/report/summary.json: $(CONFIGS)/%.yaml $$(call if_made,$$*,model.h5 trajectories.h5 reduction.h5 validation.h5 log.h5 identification.h5 terms.h5 samples.h5) | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) report $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

.PRECIOUS: $(RESULTS)/%/log.h5 $(RESULTS)/%/model.h5 $(RESULTS)/%/trajectories.h5 $(RESULTS)/%/samples.h5 $(RESULTS)/%/reduction.h5 $(RESULTS)/%/terms.h5 $(RESULTS)/%/validation.h5 $(RESULTS)/%/identification.h5 $(RESULTS)/%/report/summary.json
