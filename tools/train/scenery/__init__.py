# SPDX-License-Identifier: Apache-2.0
"""Random scenes to train denoisers on."""
