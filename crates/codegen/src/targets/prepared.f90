  type(solution), save :: s
  logical, save :: is_ready = .false.

contains

  subroutine make_ready()
    type(parameters) :: p
    character(:), allocatable :: message
    if (is_ready) return
    call prepare(s, p, message)
    if (len(message) > 0) then
      write (*, "(a)") message
      error stop 2
    end if
    TABLE
    is_ready = .true.
  end subroutine

