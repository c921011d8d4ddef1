# Written by `paramreduce graph --format make`; do not edit.
# One rule per stage: `make results/ROBOT/reduction.h5` does just what is missing.
PARAMREDUCE ?= paramreduce
CONFIGS ?= configs
RESULTS ?= results
PARAMREDUCE_FLAGS ?=
# What must be there before paramreduce can be called, such as an installation.
PARAMREDUCE_READY ?=
# Files that there are for some robots only: with a log, without one, with terms to leave out.
has_log = $(shell grep -Es '^ +log:' $(CONFIGS)/$(1).yaml)
with_log = $(if $(call has_log,$(1)),$(2))
without_log = $(if $(call has_log,$(1)),,$(2))
with_terms = $(if $(shell grep -Es '^terms:' $(CONFIGS)/$(1).yaml),$(2))
.SECONDEXPANSION:

$(RESULTS)/%/model.h5: $(CONFIGS)/%.yaml | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) build-model $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/trajectories.h5: $(CONFIGS)/%.yaml $(RESULTS)/%/model.h5 | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) optimize-trajectories $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/log.h5: $(CONFIGS)/%.yaml $(RESULTS)/%/model.h5 | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) process-log $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/samples.h5: $(CONFIGS)/%.yaml $(RESULTS)/%/model.h5 $$(call without_log,$$*,$(RESULTS)/$$*/trajectories.h5) $$(call with_log,$$*,$(RESULTS)/$$*/log.h5) | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) sample $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/reduction.h5: $(CONFIGS)/%.yaml $(RESULTS)/%/model.h5 $(RESULTS)/%/samples.h5 | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) reduce $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/terms.h5: $(CONFIGS)/%.yaml $(RESULTS)/%/model.h5 $(RESULTS)/%/samples.h5 $(RESULTS)/%/reduction.h5 | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) reduce-terms $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/validation.h5: $(CONFIGS)/%.yaml $(RESULTS)/%/model.h5 $(RESULTS)/%/samples.h5 $(RESULTS)/%/reduction.h5 | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) validate $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/identification.h5: $(CONFIGS)/%.yaml $$(call with_log,$$*,$(RESULTS)/$$*/log.h5) $(RESULTS)/%/model.h5 $(RESULTS)/%/samples.h5 $(RESULTS)/%/validation.h5 | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) identify $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

$(RESULTS)/%/report/summary.json: $(CONFIGS)/%.yaml $(RESULTS)/%/model.h5 $$(call without_log,$$*,$(RESULTS)/$$*/trajectories.h5) $(RESULTS)/%/samples.h5 $(RESULTS)/%/reduction.h5 $(RESULTS)/%/validation.h5 $$(call with_log,$$*,$(RESULTS)/$$*/log.h5) $$(call with_log,$$*,$(RESULTS)/$$*/identification.h5) $$(call with_terms,$$*,$(RESULTS)/$$*/terms.h5) | $(PARAMREDUCE_READY)
	$(PARAMREDUCE) report $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)

.PRECIOUS: $(RESULTS)/%/model.h5 $(RESULTS)/%/trajectories.h5 $(RESULTS)/%/log.h5 $(RESULTS)/%/samples.h5 $(RESULTS)/%/reduction.h5 $(RESULTS)/%/terms.h5 $(RESULTS)/%/validation.h5 $(RESULTS)/%/identification.h5 $(RESULTS)/%/report/summary.json
