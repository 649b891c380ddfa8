"""The judge: what an action will really bring, given what the models foresee of it and what the camera sees."""
