-- Photographs as cameras make them: of any size, of few or many bits, with black levels and exposures.
-- Where the camera sees the display's pixels.
alter table dataset add column alignment text check (json_valid(alignment));
-- bits of the camera where they are fewer than the files'; 0: the files'
alter table dataset add column photo_bit_depth integer not null default 0 check (photo_bit_depth between 0 and 16);

create trigger alignment_of_finalized_dataset_stays before update of alignment, photo_bit_depth on dataset
when old.digest is not null
begin select raise(abort, 'the dataset is finalized'); end;

-- black level, exposure time and amplification; null where nothing is known
alter table pair add column exposure text check (json_valid(exposure));
-- what was measured of the pair with the dataset's alignment; null where nothing was yet
alter table pair add column checks text check (json_valid(checks));
