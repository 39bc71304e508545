! A UMAT that is linear elastic (E = PROPS(2), nu = 0) until increment 13. There it does what PROPS(1) says:
! 1 crash, 2 endless loop, 3 NaN in STRESS, 4 NaN in DDSDDE, 5 STOP, 6 ERROR STOP, 7 abort, 8 writes past STATEV,
! 9 writes before STRESS, 10 refuses the step by PNEWDT, 11 reads a property that was not given, 12 writes far past STATEV.
! It prints in every call. DDSDDE: d stress / d DSTRAN.
subroutine umat(stress, statev, ddsdde, sse, spd, scd, rpl, ddsddt, drplde, drpldt, stran, dstran, time, dtime, &
    temp, dtemp, predef, dpred, cmname, ndi, nshr, ntens, nstatv, props, nprops, coords, drot, pnewdt, celent, &
    dfgrd0, dfgrd1, noel, npt, layer, kspt, jstep, kinc)
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_intptr_t, c_null_ptr
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  integer :: ndi, nshr, ntens, nstatv, nprops, noel, npt, layer, kspt, jstep(4), kinc
  double precision :: stress(*), statev(*), ddsdde(ntens, ntens), sse, spd, scd, rpl, ddsddt(ntens)
  double precision :: drplde(ntens), drpldt, stran(ntens), dstran(ntens), time(2), dtime, temp, dtemp, predef(1)
  double precision :: dpred(1), props(*), coords(3), drot(3, 3), pnewdt, celent, dfgrd0(3, 3), dfgrd1(3, 3)
  character(len=80) :: cmname
  integer, pointer :: nowhere
  integer :: i, past

  write (*, *) 'bad.f90 prints: increment', kinc
  ddsdde = 0
  do i = 1, ntens
    ddsdde(i, i) = merge(props(2), props(2) / 2, i <= ndi)
  end do
  stress(1:ntens) = stress(1:ntens) + matmul(ddsdde, dstran)
  if (kinc /= 13) return
  past = nstatv + 1
  select case (nint(props(1)))
  case (1)
    call c_f_pointer(transfer(8_c_intptr_t, c_null_ptr), nowhere)
    nowhere = kinc
  case (2)
    do while (pnewdt > 0)
      call wait_for(pnewdt)
    end do
  case (3)
    stress(4) = ieee_value(stress(4), ieee_quiet_nan)
  case (4)
    ddsdde(2, 4) = ieee_value(stress(4), ieee_quiet_nan)
  case (5)
    stop 'bad.f90 stops'
  case (6)
    error stop 3
  case (7)
    call abort()
  case (8)
    statev(past) = 1
  case (9)
    stress(past - 1 - nstatv) = 1
  case (10)
    pnewdt = 0.25d0
  case (11)
    stress(1) = props(nprops + 1)
  case (12)
    do i = past, past + 100000000
      statev(i) = 1
    end do
  end select

contains

  ! Keeps the compiler from removing the loop.
  subroutine wait_for(factor)
    double precision, volatile, intent(inout) :: factor
    factor = factor * 1
  end subroutine wait_for
end subroutine umat
